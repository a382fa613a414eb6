"""Every kind of estimator through the one interface."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from estimation.bank.states import Bank
from estimation.campaign import Campaign
from estimation.closing import closing_samples, processed
from estimation.cross_validation import closing_score
from estimation.estimator import Estimator, Recipe, load
from estimation.estimators.bank import BankRecipe
from estimation.estimators.model import ModelRecipe
from estimation.estimators.network import NetworkEstimator, NetworkRecipe
from estimation.estimators.residual import ResidualEstimator, ResidualRecipe
from estimation.model_file import read
from estimation.networks.network import NetworkError
from estimation.networks.training import Settings, has_torch
from estimation.recording import MissingChannelError, Recording

pytestmark = pytest.mark.integration

torch_only = pytest.mark.skipif(not has_torch(), reason="torch is not installed (extra learn)")
TARGET = "proximal_torque_n_m"
PAPER_INPUTS = ("spindle_angle_rad", "spindle_velocity_rad_s", "motor_current_a")
STATES = (*PAPER_INPUTS, "motor_acceleration_rad_s2", "spindle_travel_rad")
SMALL = Settings(nodes=6, iterations=60)

RECIPES: dict[str, Recipe] = {
    "linear": ModelRecipe(read(Path("linear"))),
    "physical": ModelRecipe(read(Path("motor"))),
    "bank": BankRecipe(TARGET, Bank("motor_current_a")),
    "network": NetworkRecipe(PAPER_INPUTS, TARGET, SMALL),
    "states": NetworkRecipe(STATES, TARGET, SMALL),
    "residual": ResidualRecipe(
        ModelRecipe(read(Path("linear"))), NetworkRecipe(STATES, TARGET, replace(SMALL, nodes=4))
    ),
}
KINDS = [
    pytest.param(kind, marks=() if kind in ("linear", "physical", "bank") else torch_only)
    for kind in RECIPES
]


@pytest.fixture(scope="module")
def fitted(runs, states):
    known: dict[str, Estimator] = {"bank": states}

    def fit(kind: str) -> Estimator:
        if kind not in known:
            known[kind] = RECIPES[kind].fit(Campaign.of(runs[1:]))
        return known[kind]

    return fit


def closing_error(estimator: Estimator, run: Recording, causal: bool = False) -> float:
    truth = processed(run, [TARGET])
    both = closing_samples(truth.with_columns(estimate_n_m=estimator.predict(run, causal)))
    return float(np.sqrt(np.mean((both["estimate_n_m"] - both[TARGET]) ** 2)))


def test_an_error_on_runs_left_out_is_by_estimators_that_have_not_seen_them(runs):
    done: list[None] = []
    few = Campaign.of(runs[:3])
    found = closing_score(RECIPES["linear"], few, 3, on_fold=lambda: done.append(None))
    assert len(done) == 3
    errors = [
        closing_error(RECIPES["linear"].fit(split.train), run)
        for split in few.folds(3, 0)
        for run in split.test
    ]
    assert min(errors) <= found.rmse <= max(errors)
    assert found.samples == sum(len(closing_samples(processed(run, [TARGET]))) for run in few)


@pytest.mark.parametrize("kind", KINDS)
def test_it_estimates_a_run_it_has_not_seen(kind, fitted, runs):
    estimator = fitted(kind)
    assert estimator.target == TARGET
    error = closing_error(estimator, runs[0])
    assert error < (0.03 if kind == "linear" else 0.01)
    if kind == "residual":
        assert error < 0.5 * closing_error(fitted("linear"), runs[0])


@pytest.mark.parametrize("kind", KINDS)
def test_live_and_causal_prediction_agree_however_samples_come(kind, fitted, runs):
    estimator, run = fitted(kind), runs[0]
    whole = estimator.predict(run, causal=True)
    stepper = estimator.stepper(run.sample_rate_hz)
    parts = []
    for part in np.split(np.arange(1200), [1, 2, 3, 400, 1100]):
        measured = {name: run[name][part] for name in stepper.channels}
        parts.append(stepper.step(run.time_s[part], measured))
    np.testing.assert_allclose(np.concatenate(parts), whole[:1200], atol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_a_file_gives_the_same_estimator_back(kind, fitted, runs, tmp_path):
    estimator = fitted(kind)
    path = tmp_path / ("e.toml" if kind in ("linear", "physical") else "e.npz")
    estimator.save(path)
    again = load(path)
    assert type(again) is type(estimator)
    np.testing.assert_allclose(again.predict(runs[0]), estimator.predict(runs[0]), rtol=1e-12)


@torch_only
def test_what_does_not_fit_together_is_refused(fitted, runs, tmp_path):
    network = fitted("network")
    bare = replace(runs[0], columns={TARGET: runs[0][TARGET]})
    with pytest.raises(MissingChannelError):
        network.predict(bare)
    with pytest.raises(NetworkError, match="No runs"):
        RECIPES["network"].fit(Campaign(()))
    with pytest.raises(NetworkError, match="the network distal_torque_n_m"):
        ResidualEstimator(
            read(Path("linear")),
            replace(network, network=replace(network.network, outputs=("distal_torque_n_m",))),
        )
    arrays = network.arrays()
    del arrays["low_pass"]
    with pytest.raises(NetworkError, match="filter"):
        NetworkEstimator.from_arrays(arrays)
