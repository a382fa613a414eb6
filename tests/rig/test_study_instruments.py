"""An instrument's estimators on another one: rows, table, and that adapting helps."""

from dataclasses import replace

import pytest

from estimation.campaign import Campaign
from estimation.recording import Recording
from rig.studies.instruments.page import page
from rig.studies.instruments.study import run_instruments
from tests.estimation.synthetic import campaign

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
    assert [row[2] for row in page(study).tables[1].rows] == ["9", "40"]
