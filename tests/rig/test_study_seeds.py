"""Seeds of a study are kept, and only what is missing or damaged is made again."""

from dataclasses import dataclass
from pathlib import Path

import pytest

from rig.studies.seeds import Keeper, kept_outcomes

pytestmark = pytest.mark.integration


@dataclass(frozen=True)
class Square:
    value: int


made: list[int] = []


def square(seed: int) -> Square:
    made.append(seed)
    return Square(seed * seed)


def run(state: Path, seeds: int, schema: str = "squares/1") -> tuple[list[int], int]:
    made.clear()
    told: list[None] = []
    keeper = Keeper(state, on_seed=lambda: told.append(None))
    found = kept_outcomes(Square, square, seeds, schema, keeper)
    assert len(told) == seeds
    return [each.value for each in found], len(made)


def test_a_stopped_study_goes_on_and_a_damaged_outcome_is_made_again(tmp_path):
    assert run(tmp_path, 2) == ([0, 1], 2)
    assert run(tmp_path, 4) == ([0, 1, 4, 9], 2)
    assert run(tmp_path, 4) == ([0, 1, 4, 9], 0)
    next(tmp_path.glob("*-3.json")).write_text("{")
    assert run(tmp_path, 4) == ([0, 1, 4, 9], 1)
    assert run(tmp_path, 2, "squares/2") == ([0, 1], 2)  # another layout is another study
