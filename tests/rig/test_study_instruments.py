"""An instrument's estimators on another one: adapting helps, and intervals hold."""

from dataclasses import replace

import numpy as np
import pytest

from estimation.campaign import Campaign
from estimation.recording import Recording
from rig.studies.instruments import intervals_page
from rig.studies.instruments.intervals import TARGETS, run_intervals
from rig.studies.instruments.page import page
from rig.studies.instruments.study import KINDS, drawn, run_instruments
from rig.studies.oneill.kinds import recipes
from rig.studies.oneill.paper import PROXIMAL
from tests.estimation.synthetic import campaign, campaign_with_jaw

pytestmark = pytest.mark.long

TARGET = "proximal_torque_n_m"


def other(run: Recording) -> Recording:
    return run.with_columns(**{TARGET: run[TARGET] + 0.02 + 0.03 * run["spindle_angle_rad"]})


@pytest.fixture(scope="module")
def study():
    runs = [replace(run, name=f"{k:02}") for k, run in enumerate(campaign())]
    return run_instruments(
        ("own", Campaign.of(runs)),
        {"other": Campaign.of(other(run) for run in runs)},
        used=(("01",), ("01", "05")),
        networks=False,
    )


def test_adapting_helps_and_a_fit_anew_stands_beside_the_first_row(study):
    first, second = (row.result for row in study.rows)
    for result in (first, second):
        assert result.adapted.rmse < 0.5 * result.as_it_is.rmse
    assert first.scratch is not None
    assert second.scratch is None
    assert len(second.unused) == len(first.unused) - 1


def test_every_single_run_and_threes_are_adapted_with(study):
    one, three = study.drawn
    assert (one.runs, len(one.rmse_n_m)) == (1, 9)
    assert (three.runs, len(three.rmse_n_m)) == (3, 40)
    for row in study.drawn:
        assert row.rmse_n_m[0] <= row.rmse_n_m[-1] < study.rows[0].result.as_it_is.rmse
        assert 0 <= row.covered <= 1
    # the single run of the first row is one of the choices, there scored on every fourth sample
    wanted = study.rows[0].result.adapted.rmse
    assert min(abs(error - wanted) for error in one.rmse_n_m) < 0.01 * wanted
    assert [row[1:4] for row in page(study).tables[1].rows] == [
        ["all", "1", "9"],
        ["all", "3", "40"],
    ]


def test_runs_at_another_zero_are_left_out_in_rows_of_their_own():
    runs = [
        replace(run, name=f"{k:02}", conditions={**run.conditions, "motor_zero_offset_rad": zero})
        for k, (run, zero) in enumerate(zip(campaign(), [*np.arange(7.0), 50.0, 51.0], strict=True))
    ]
    recipe = recipes()[KINDS[0]]
    source = recipe.fit(Campaign.of(runs))
    rows = drawn(source, "other", Campaign.of(other(run) for run in runs), 0)
    assert [(row.usual, row.runs, len(row.rmse_n_m)) for row in rows] == [
        (False, 1, 9),
        (False, 3, 40),
        (True, 1, 7),
        (True, 3, 40),
    ]


@pytest.fixture(scope="module")
def covered():
    runs = list(campaign_with_jaw())
    other = [run.with_columns(**{PROXIMAL: run[PROXIMAL] + 0.02}) for run in runs]
    both = {"own": Campaign.of(runs), "other": Campaign.of(other)}
    return run_intervals(both, ["own", "other"])


def test_each_run_is_held_out_once_and_once_for_each_condition(covered):
    for name in ("own", "other"):
        for target in TARGETS:
            rows = [r for r in covered.levels if (r.instrument, r.target) == (name, target)]
            by = {row.left_out: row for row in rows}
            assert by["run"].runs == 9
            assert by["edge"].runs + by["between"].runs == 2 * 9
    for row in (*covered.levels, *covered.adapted):
        assert row.worst_run <= row.worst_level <= row.covered <= 1
        assert row.worst_run <= row.median <= 1
        assert 0 <= row.no_width < 1
        assert row.half_width > 0


def test_adapted_rows_hold_the_runs_that_were_not_adapted_with(covered):
    assert {(row.left_out, row.runs) for row in covered.adapted} == {("1 run", 8), ("3 runs", 6)}
    moved = [row for row in covered.adapted if row.target == PROXIMAL]
    assert all(row.rmse < 0.01 for row in moved)  # the other zero is taken up


def test_the_page_states_the_aims_and_every_row(covered):
    shown = intervals_page.page(covered)
    levels, adapted = shown.tables
    assert len(levels.rows) == len(covered.levels)
    assert len(adapted.rows) == len(covered.adapted)
    assert "1.4 times that on unseen runs" in shown.paragraphs[0]
    usual = [row for row in levels.rows if row[2] == "run"]
    assert {row[-2] for row in usual} == {"1.00"}
