"""Numbers of the papers that are typed in code, against the papers' texts, and their rows."""

import os
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from rig.studies.coverage import STATES, coverage, rows
from rig.studies.delsol.study import PEAK_PERCENT, STIFFNESS_N_M, TABLE_1_HZ, TABLE_2_N_M, TABLE_5_N
from rig.studies.oneill.paper import PAPER as ONEILL
from rig.studies.oneill.paper import PAPER_POSE_SAMPLES
from rig.studies.pique.study import THESIS_TABLE_3_2
from rig.studies.seeds import Keeper, kept_outcomes
from rig.studies.wrench.study import SERIES, TABLES
from rig.studies.zhang.study import PAPER as ZHANG
from rig.studies.zhang.study import PAPER_FORCE_N, PAPER_MOMENT_N_M
from rig.studies.zhao.methods import PAPER_COEFFICIENTS, PAPER_DELAYS_MS, PAPER_ERRORS_N

PAPERS = ("oneill", "pique", "delsol", "zhang", "zhao")


@pytest.fixture(scope="module")
def texts(measured_data):
    """Each paper's text by the name of its study; rows of tables keep their lines."""
    folder = Path(os.environ.get("RIG_PAPERS", measured_data.parent / "papers"))
    found = {file.name.partition("-")[0]: file.read_text("utf-8") for file in folder.glob("*.txt")}
    if set(found) != set(PAPERS):
        pytest.skip(f"no texts of the papers at {folder} (set RIG_PAPERS to their folder)")
    return found


def printed(text: str, *numbers: float, digits: int, least: int = 1) -> bool:
    """Whether a line has these numbers one after another, each with so many digits."""
    shown = [rf"(?<![\d.]){re.escape(f'{number:.{digits}f}')}(?!\d)" for number in numbers]
    pattern = r"[^\n\d]*(?:\(\d+\.\d+\))?[^\n\d]*".join(shown)
    return len(re.findall(pattern, text)) >= least


def rows_typed() -> Iterator[tuple[str, int, tuple[float | None, ...]]]:
    """Yield the rows of tables that are typed in code: paper, digits and numbers."""
    yield from (("oneill", 2, row) for row in ONEILL.values())
    yield from (("pique", 2, row) for row in TABLES.values())
    yield from (("delsol", 3, row) for row in (*TABLE_1_HZ, TABLE_2_N_M, TABLE_5_N))
    for name, row in ZHANG.items():
        if name.startswith("I"):
            yield "zhang", 2 if name.startswith("I ") else 3, row


@pytest.mark.measured
def test_every_row_typed_is_a_row_of_its_paper_as_often_as_it_is_typed(texts):
    for (paper, digits, row), count in Counter(rows_typed()).items():
        known = [number for number in row if number is not None]
        least = count if paper == "oneill" else 1
        assert printed(texts[paper], *known, digits=digits, least=least), (paper, row)
    assert TABLES[SERIES] == THESIS_TABLE_3_2


@pytest.mark.measured
def test_every_number_typed_alone_is_in_its_paper(texts):
    rmse, nrmse, scale = ZHANG["grasp | RMSE, NRMSE, scale"]
    moments = [f"{moment} Nm" for moment in PAPER_MOMENT_N_M]
    grasp = [f"{nrmse}%", f"{rmse} N", f"${scale:.0f}\\,m^{{-1}}$", f"{PAPER_FORCE_N} N"]
    slopes = [f"1/{one:.2f}" for one in PAPER_COEFFICIENTS.values() if one is not None]
    words = {
        "oneill": [f"{PAPER_POSE_SAMPLES:,}"],
        "delsol": [f"{PEAK_PERCENT}%", f"{STIFFNESS_N_M:.0f}[N/m]"],
        "zhang": [*grasp, *moments],
        "zhao": slopes,
    }
    assert [(p, word) for p, own in words.items() for word in own if word not in texts[p]] == []


@pytest.mark.measured
@pytest.mark.parametrize("dof", PAPER_ERRORS_N)
def test_errors_and_delays_typed_of_zhao_are_in_the_paper(texts, dof):
    text, name = texts["zhao"], f"{dof.capitalize()} test"
    place = text.index(name, text.index("Table 3"))
    assert printed(text[place : place + 40], *PAPER_ERRORS_N[dof], digits=2)
    assert re.search(rf"{name}\s+{PAPER_DELAYS_MS[dof]:.0f}\s", text)


@pytest.mark.parametrize("paper", PAPERS)
def test_every_row_of_a_paper_has_a_state_and_a_place_or_reason(paper):
    assert len(rows(paper)) >= 10
    for section, what, state, where in rows(paper):
        assert all((section, what, where))
        assert state in STATES, what


def test_a_page_shows_only_the_rows_of_its_command():
    shown = {tuple(row) for row in coverage("pique", "wrench").rows}
    assert shown < set(rows("pique"))
    assert {tuple(row) for row in coverage("pique").rows} == set(rows("pique"))


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


@pytest.mark.integration
def test_a_stopped_study_goes_on_and_a_damaged_outcome_is_made_again(tmp_path):
    assert run(tmp_path, 2) == ([0, 1], 2)
    assert run(tmp_path, 4) == ([0, 1, 4, 9], 2)
    assert run(tmp_path, 4) == ([0, 1, 4, 9], 0)
    next(tmp_path.glob("*-3.json")).write_text("{")
    assert run(tmp_path, 4) == ([0, 1, 4, 9], 1)
    assert run(tmp_path, 2, "squares/2") == ([0, 1], 2)  # another layout is another study
