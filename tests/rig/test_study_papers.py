"""Numbers of the papers that are typed in code, against the papers' texts, and their rows."""

import os
import re
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


@pytest.mark.measured
def test_every_number_typed_of_oneill_is_a_row_of_the_paper(texts):
    for row in set(ONEILL.values()):
        same = sum(other == row for other in ONEILL.values())
        assert printed(texts["oneill"], *row, digits=2, least=same), row
    assert f"{PAPER_POSE_SAMPLES:,}" in texts["oneill"]


@pytest.mark.measured
def test_every_number_typed_of_pique_is_a_row_of_the_thesis(texts):
    assert TABLES[SERIES] == THESIS_TABLE_3_2
    for row in TABLES.values():
        assert printed(texts["pique"], *row, digits=2), row


@pytest.mark.measured
def test_every_number_typed_of_delsol_is_in_the_paper(texts):
    for row in (*TABLE_1_HZ, TABLE_2_N_M, TABLE_5_N):
        assert printed(texts["delsol"], *row, digits=3), row
    assert f"{PEAK_PERCENT}%" in texts["delsol"]
    assert f"{STIFFNESS_N_M:.0f}[N/m]" in texts["delsol"]


@pytest.mark.measured
def test_every_number_typed_of_zhang_is_in_the_paper(texts):
    for name, row in ZHANG.items():
        known = [number for number in row if number is not None]
        if name.startswith("I "):
            assert printed(texts["zhang"], *known, digits=2), name
        elif name.startswith("II "):
            assert printed(texts["zhang"], *known, digits=3), name
    rmse, nrmse, scale = ZHANG["grasp | RMSE, NRMSE, scale"]
    assert f"{nrmse}%" in texts["zhang"]
    assert f"{rmse} N" in texts["zhang"]
    assert f"${scale:.0f}\\,m^{{-1}}$" in texts["zhang"]
    assert f"{PAPER_FORCE_N} N" in texts["zhang"]
    assert all(f"{moment} Nm" in texts["zhang"] for moment in PAPER_MOMENT_N_M)


@pytest.mark.measured
def test_every_number_typed_of_zhao_is_in_the_paper(texts):
    for dof, row in PAPER_ERRORS_N.items():
        place = texts["zhao"].index(f"{dof.capitalize()} test", texts["zhao"].index("Table 3"))
        assert printed(texts["zhao"][place : place + 40], *row, digits=2), dof
    for dof, delay in PAPER_DELAYS_MS.items():
        assert re.search(rf"{dof.capitalize()} test\s+{delay:.0f}\s", texts["zhao"]), dof
    for coefficient in PAPER_COEFFICIENTS.values():
        assert coefficient is None or f"1/{coefficient:.2f}" in texts["zhao"]


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
