"""Runs of the analytic rig, and fits on them, made once for all tests of this folder."""

from pathlib import Path

import pytest

from estimation import model_file
from estimation.bank.states import Bank
from estimation.campaign import Campaign
from estimation.estimators.bank import BankEstimator, BankRecipe
from estimation.fitting import fit
from estimation.model import Model
from estimation.recording import Recording
from tests.estimation.synthetic import campaign


@pytest.fixture(scope="session")
def runs() -> list[Recording]:
    return list(campaign())


@pytest.fixture(scope="session")
def motor(runs) -> Model:
    return fit(model_file.read(Path("motor")), Campaign.of(runs))


@pytest.fixture(scope="session")
def states(runs) -> BankEstimator:
    """Return a state estimator fitted on all runs but the first."""
    recipe = BankRecipe("proximal_torque_n_m", Bank("motor_current_a"))
    return recipe.fit(Campaign.of(runs[1:]))
