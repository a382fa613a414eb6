"""The rig of fitted models: the recorded plant with its noise; effects its equations may have."""

from dataclasses import replace

import numpy as np
import pytest

from estimation import model_file
from estimation.campaign import Campaign
from estimation.causes.verdict import diagnose
from estimation.diagnosis.split import split
from estimation.effects import effect
from estimation.fitting import fit
from estimation.model import Model, NotFittedError
from estimation.recording import MissingChannelError, Recording
from rig.errors import DataError
from rig.protocols.protocol import load_protocol
from rig.simulation.campaign import bench_at, simulated_run
from rig.simulation.fitted import DECLARED_PLANT, plant_of
from rig.simulation.fitted_rig import fitted_rig, noise_std
from rig.simulation.parameters import SensorParameters, vary
from rig.simulation.reference_roles import candidates

pytestmark = pytest.mark.integration

PLANT = vary(DECLARED_PLANT, 3)
SENSORS = vary(SensorParameters(), 3)
PLANS = load_protocol("diagnosis").plans()[::2]
NOISE = {"motor": 2e-3, "gearbox": 0.1e-3, "cable": 0.6e-3, "stretch": 0.3e-3}
"""What the sensors leave: the current's noise, encoder counts, and at the cable the spindle's
counts through the steep change of sign of its friction; N m or rad."""


@pytest.fixture(scope="module")
def recorded() -> list[Recording]:
    runs = []
    for seed, plan in enumerate(PLANS):
        bench = bench_at(float(plan.target_angle_rad[0]), PLANT, SENSORS, seed=seed)
        runs.append(simulated_run(bench, plan, "simulated"))
    return runs


@pytest.fixture(scope="module")
def fitted(recorded: list[Recording]) -> list[Model]:
    campaign = Campaign.of(recorded)
    return [fit(model, campaign, bootstrap=0) for model in model_file.reference_rig()]


@pytest.fixture(scope="module")
def played(recorded: list[Recording], fitted: list[Model]) -> list[Recording]:
    rig = fitted_rig(fitted, recorded)
    return [rig.play(plan, 5_000_015 + k) for k, plan in enumerate(PLANS)]


def test_fitted_balances_give_back_the_plant_they_came_from(fitted):
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


def test_the_declared_balances_leave_what_the_sensors_leave(fitted):
    left = {model.balance: model.evidence.rmse for model in fitted if model.evidence}
    assert left.keys() == NOISE.keys()
    for balance, rmse in left.items():
        assert 0.3 * NOISE[balance] < rmse < NOISE[balance], balance


@pytest.mark.parametrize("channel", ["proximal_torque_n_m", "distal_torque_n_m", "motor_current_a"])
def test_the_fitted_rigs_noise_floor_is_the_recordings(recorded, played, channel):
    ratios = [
        noise_std(made[channel], 1000.0) / noise_std(measured[channel], 1000.0)
        for measured, made in zip(recorded, played, strict=True)
    ]
    assert 1 / 1.1 < np.median(ratios) < 1.1


@pytest.mark.parametrize("place", range(4), ids=["motor", "gearbox", "cable", "stretch"])
def test_the_fitted_rigs_residual_has_the_recordings_size(fitted, played, place):
    again = fit(fitted[place], Campaign.of(played), bootstrap=0)
    before = fitted[place].evidence
    assert again.evidence.rmse == pytest.approx(before.rmse, rel=0.25)


def test_a_diagnosis_of_the_fitted_rig_finds_nothing_in_the_motor(fitted, played):
    assert diagnose(played, fitted[:1], split(played)).findings == ()


def test_runs_without_trajectory_or_channels_and_an_unfitted_model_are_refused(recorded, fitted):
    run = recorded[0]
    with pytest.raises(DataError, match="without its trajectory"):
        fitted_rig(fitted, [run.with_columns(target_angle_rad=np.zeros(len(run)))])
    with pytest.raises(MissingChannelError):
        fitted_rig(fitted, [replace(run, columns={"motor_angle_rad": run["motor_angle_rad"]})])
    with pytest.raises(NotFittedError):
        fitted_rig(model_file.reference_rig(), recorded)


CHANNELS = ("motor_current_a", "motor_angle_rad", "spindle_angle_rad")


def test_what_acts_at_rest_is_searched_where_samples_at_rest_count():
    moving = {t.effect.id for t in candidates("motor", CHANNELS)}
    resting = {t.effect.id for t in candidates("motor", CHANNELS, at_rest=True)}
    assert {i for i in resting if effect(i).at_rest} == resting - moving
    assert "friction.load.sticking" in resting


def test_a_channel_may_play_the_roles_of_another():
    instead = {"motor_current_a": "motor_command_ratio", "motor_load_n_m": "motor_command_ratio"}
    measured = ("motor_command_ratio", "motor_angle_rad", "spindle_angle_rad")
    found = [term.channels for term in candidates("motor", measured, instead)]
    assert any(c.get("current") == "motor_command_ratio" for c in found)
    assert all("motor_current_a" not in c.values() for c in found)
