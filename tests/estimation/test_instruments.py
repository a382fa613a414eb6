"""A regressor's noise is not taken for an effect: it is projected where an effect could fit it."""

from dataclasses import replace

import numpy as np
import pytest

from estimation.campaign import Campaign
from estimation.diagnosis.balance import lay_out
from estimation.diagnosis.candidate import Candidate, projected
from estimation.diagnosis.design import prepare, tables
from estimation.diagnosis.evidence import leave_one_run_out
from estimation.diagnosis.instruments import instruments, projection
from estimation.effects import effect
from estimation.fitting import fit
from estimation.model import Term
from estimation.model_file import read, shipped
from estimation.recording import Recording
from tests.estimation.synthetic import run

NOISE_A = 5e-3
MEASURED = (
    "motor_angle_rad",
    "spindle_angle_rad",
    "motor_current_a",
    "proximal_torque_n_m",
    "distal_torque_n_m",
)
CURRENT = "motor_current_a"
LAGS = [
    Candidate.of(Term(effect("motor.electrical"), 1, {}), [0.008]),
    Candidate.of(Term(effect("sensor.lag"), 1, {"reading": CURRENT}), [0.008]),
    Candidate.of(Term(effect("sensor.delay"), 1, {"reading": CURRENT}), [0.019]),
]


def quiet(k: int) -> Recording:
    """Return a run whose current has no noise."""
    return run(f"r{k}", 0.1, 0.05 + 0.01 * k, seed=k, noise_n_m=1e-4)


@pytest.fixture(scope="module")
def noisy():
    runs = []
    for k in range(5):
        made = quiet(k)
        noise = NOISE_A * np.random.default_rng(100 + k).normal(size=len(made))
        runs.append(made.with_columns(**{CURRENT: made[CURRENT] + noise}))
    model = fit(read(shipped()["motor"]), Campaign.of(runs), bootstrap=0)
    names = [*model.channels, model.target, *instruments(MEASURED)]
    return model, [prepare(r, names, model) for r in runs]


def gains(model, runs) -> np.ndarray:
    balance = lay_out(model, runs)
    left = [r[:, None] for r in balance.left(balance.terms)]
    table = tables(runs, LAGS, balance.demean)
    return leave_one_run_out(balance.base(balance.terms), table, [1] * len(LAGS), left).gain[:, 0]


def test_a_lag_of_a_noisy_regressor_gains_only_by_its_noise(noisy):
    model, runs = noisy
    told = projection(runs, LAGS, model.target)
    assert gains(model, runs).max() > 0.04
    assert gains(model, [told(r) for r in runs]).max() < 0.005


def test_the_projection_carries_the_motion_and_less_noise(noisy):
    model, runs = noisy
    told = projection(runs, LAGS, model.target)(runs[0])
    clean, measured, true = told.channels[projected(CURRENT)], told.channels[CURRENT], quiet(0)
    wrong = [np.std((x - true[CURRENT])[runs[0].used]) for x in (clean, measured)]
    assert wrong[0] < 0.5 * wrong[1]


def test_without_other_sensors_the_reading_stays_as_it_is(noisy):
    model, runs = noisy
    alone = [prepare_without(r) for r in runs]
    told = projection(alone, LAGS, model.target)
    assert projected(CURRENT) not in told(alone[0]).channels
    assert instruments(["joint_1_angle_rad"]) == []


def prepare_without(prepared):
    left = {k: v for k, v in prepared.channels.items() if k != "distal_torque_n_m"}
    return replace(prepared, channels=left)
