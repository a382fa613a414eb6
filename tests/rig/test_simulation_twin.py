"""The simulated null: the declared model with the references and noise of a recording."""

from dataclasses import replace

import numpy as np
import pytest

from estimation.campaign import Campaign
from estimation.causes.verdict import diagnose
from estimation.diagnosis.split import split
from estimation.fitting import fit
from estimation.model import Model, NotFittedError
from rig.errors import DataError
from rig.simulation.fitted import DECLARED_PLANT, noise_std, plant_of
from rig.simulation.parameters import SensorParameters, vary
from rig.simulation.twin import build_twin
from tests.rig import declared_models as declared

pytestmark = pytest.mark.integration

PLANT = vary(DECLARED_PLANT, 3)
SENSORS = vary(SensorParameters(), 3)
NOISE_FACTOR = 1.1
"""How far a twin's noise may be from the recording's."""


@pytest.fixture(scope="module")
def recorded() -> Campaign:
    return Campaign.of(declared.record(PLANT, SENSORS))


@pytest.fixture(scope="module")
def fitted(recorded: Campaign) -> list[Model]:
    return [fit(model, recorded, bootstrap=0) for model in declared.MODELS]


@pytest.fixture(scope="module")
def twin(recorded: Campaign, fitted: list[Model]) -> Campaign:
    return Campaign.of(build_twin(fitted, recorded)(5_000_015))


def test_fitted_balances_give_back_the_plant_they_came_from(fitted: list[Model]) -> None:
    found = plant_of(fitted)
    for name in (
        "torque_constant_n_m_a",
        "rotor_inertia_kg_m2",
        "motor_friction_n_m",
        "gear_stiffness_n_m_rad",
        "spindle_friction_n_m",
        "cable_stiffness_n_m_rad",
    ):
        assert getattr(found, name) == pytest.approx(getattr(PLANT, name), rel=0.05), name


NOISE = {"motor": 2e-3, "gearbox": 0.1e-3, "cable": 0.6e-3, "stretch": 0.3e-3}
"""What the sensors leave: the current's noise, encoder counts, and at the cable the spindle's
counts through the steep change of sign of its friction; N m or rad."""


def test_the_declared_balances_leave_what_the_sensors_leave(fitted: list[Model]) -> None:
    left = {model.balance: model.evidence.rmse for model in fitted if model.evidence}
    assert left.keys() == NOISE.keys()
    for balance, rmse in left.items():
        assert 0.3 * NOISE[balance] < rmse < NOISE[balance], balance


def test_the_simulated_null_shares_names_instants_references_and_conditions(
    recorded: Campaign, twin: Campaign
) -> None:
    assert twin.names == recorded.names
    for measured, made in zip(recorded, twin, strict=True):
        assert np.array_equal(measured.time_s, made.time_s)
        assert dict(measured.conditions) == dict(made.conditions)
        for name in ("target_angle_rad", "load_command_a"):
            assert np.abs(measured[name] - made[name]).max() < 1e-3


@pytest.mark.parametrize("channel", ["proximal_torque_n_m", "distal_torque_n_m", "motor_current_a"])
def test_the_simulated_nulls_noise_floor_is_the_recordings(
    recorded: Campaign, twin: Campaign, channel: str
) -> None:
    ratios = [
        noise_std(made[channel], 1000.0) / noise_std(measured[channel], 1000.0)
        for measured, made in zip(recorded, twin, strict=True)
    ]
    assert 1 / NOISE_FACTOR < np.median(ratios) < NOISE_FACTOR


@pytest.mark.parametrize("place", range(4), ids=["motor", "gearbox", "cable", "stretch"])
def test_the_simulated_nulls_residual_has_the_recordings_size(
    fitted: list[Model], twin: Campaign, place: int
) -> None:
    again = fit(fitted[place], twin, bootstrap=0)
    assert again.evidence is not None
    before = fitted[place].evidence
    assert before is not None
    assert again.evidence.rmse == pytest.approx(before.rmse, rel=0.25)


def test_a_diagnosis_of_the_simulated_null_finds_nothing_in_the_motor(
    fitted: list[Model], twin: Campaign
) -> None:
    runs = list(twin.evidence)
    assert diagnose(runs, fitted[:1], split(runs)).findings == ()


def test_a_campaign_without_trajectory_or_an_unfitted_model_is_refused(
    recorded: Campaign, fitted: list[Model]
) -> None:
    run = next(iter(recorded))
    blind = Campaign.of([run.with_columns(target_angle_rad=np.zeros(len(run)))])
    with pytest.raises(DataError, match="trajectory was not recorded"):
        build_twin(fitted, blind)
    bare = Campaign.of([replace(run, columns={"motor_angle_rad": run["motor_angle_rad"]})])
    with pytest.raises(DataError, match="it lacks"):
        build_twin(fitted, bare)
    with pytest.raises(NotFittedError):
        build_twin(declared.MODELS, recorded)
