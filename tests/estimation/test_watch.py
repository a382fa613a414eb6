"""The residual watch on the analytic rig: quiet while the model fits, and the right run after."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from estimation import model_file
from estimation.campaign import Campaign
from estimation.fitting import fit
from estimation.model import Model
from estimation.recording import Recording
from estimation.watch import FIRST, ResidualWatch
from tests.estimation.synthetic import run


def rough(motor_rad, speed_rad_s, load_n_m):
    """Ripple that comes with a chipped tooth."""
    return 8e-4 * np.sin(4 * motor_rad)


def runs(first: int, count: int, extra=None) -> list[Recording]:
    return [
        run(f"run {k}", 0.25 + 0.1 * (k % 3), 0.05 * (1 + k % 4), seed=k, seconds=4.0, extra=extra)
        for k in range(first, first + count)
    ]


@pytest.fixture(scope="module")
def fitted() -> Model:
    return fit(model_file.read(Path("motor")), Campaign.of(runs(100, 8)), bootstrap=0)


def test_the_fit_estimates_the_spread_of_runs_and_the_file_keeps_it(fitted: Model) -> None:
    assert 0 < fitted.evidence.run_spread < 0.5
    again = model_file.parse(model_file.to_toml(fitted))
    assert again.evidence == fitted.evidence


def test_runs_that_the_model_fits_raise_no_alarm(fitted: Model) -> None:
    watch = ResidualWatch(fitted)
    sights = [watch.see(one) for one in runs(0, 24)]
    assert all(sight is not None and sight.fits for sight in sights)


def test_one_odd_run_is_no_change(fitted: Model) -> None:
    watch = ResidualWatch(fitted)
    odd = run("odd", 0.3, 0.1, seed=5, seconds=4.0, noise_n_m=50e-3)
    assert all(watch.see(one).fits for one in [*runs(0, 3), odd, *runs(3, 8)])


def test_a_model_without_evidence_learns_from_the_first_runs(fitted: Model) -> None:
    watch = ResidualWatch(replace(fitted, evidence=None))
    learning = [watch.see(one) for one in runs(0, FIRST)]
    assert all(sight.usual is None for sight in learning)
    later = [watch.see(one) for one in runs(FIRST, 6, rough)]
    assert later[-1].since == f"run {FIRST}"


def test_a_run_at_rest_has_no_report(fitted: Model) -> None:
    still = runs(0, 1)[0]
    still = still.with_columns(motor_angle_rad=np.zeros(len(still)))
    assert ResidualWatch(fitted).see(still) is None
