"""How often intervals hold: every run is held out, and the shares and widths go together."""

import pytest

from estimation.campaign import Campaign
from rig.studies.instruments.intervals import TARGETS, run_intervals
from rig.studies.instruments.intervals_page import page
from rig.studies.oneill.paper import PROXIMAL
from tests.estimation.synthetic import campaign_with_jaw

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def study():
    runs = list(campaign_with_jaw())
    other = [run.with_columns(**{PROXIMAL: run[PROXIMAL] + 0.02}) for run in runs]
    both = {"own": Campaign.of(runs), "other": Campaign.of(other)}
    return run_intervals(both, ["own", "other"])


def test_each_run_is_held_out_once_and_once_for_each_condition(study):
    for name in ("own", "other"):
        for target in TARGETS:
            rows = [r for r in study.levels if (r.instrument, r.target) == (name, target)]
            by = {row.left_out: row for row in rows}
            assert by["run"].runs == 9
            assert by["edge"].runs + by["between"].runs == 2 * 9
    for row in (*study.levels, *study.adapted):
        assert row.worst_run <= row.worst_level <= row.covered <= 1
        assert row.worst_run <= row.median <= 1
        assert 0 <= row.no_width < 1
        assert row.half_width > 0


def test_adapted_rows_hold_the_runs_that_were_not_adapted_with(study):
    assert {(row.left_out, row.runs) for row in study.adapted} == {("1 run", 8), ("3 runs", 6)}
    moved = [row for row in study.adapted if row.target == PROXIMAL]
    assert all(row.rmse < 0.01 for row in moved)  # the other zero is taken up


def test_the_page_states_the_aims_and_every_row(study):
    shown = page(study)
    levels, adapted = shown.tables
    assert len(levels.rows) == len(study.levels)
    assert len(adapted.rows) == len(study.adapted)
    assert "1.4 times that on unseen runs" in shown.paragraphs[0]
    usual = [row for row in levels.rows if row[2] == "run"]
    assert {row[-2] for row in usual} == {"1.00"}
