"""What differs between runs: stated conditions and temperatures, and levels that jump in time."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from estimation import plant_file
from estimation.causes.layout import laid_out_like, lay_out, prepared
from estimation.causes.verdict import diagnose
from estimation.diagnosis.result import Diagnosis
from estimation.diagnosis.split import split
from estimation.plant_models import declared
from estimation.recording import FloatArray
from tests.estimation.causes.synthetic import AXIS, HOIST, RATE_HZ, axis, hoisted, turning

WARM = """
[[sensor]]
name = "crank_temperature_k"
reads = "temperature"
"""
SCALED = """
[[sensor]]
name = "scaled_angle_rad"
[[equation]]
name = "drive"
target = "crank_torque_n_m"
[[equation.effects]]
id = "inertia.missing"
channels.acceleration = "crank_acceleration_rad_s2"
[[equation.effects]]
id = "inertia.missing"
channels.acceleration = "scaled_acceleration_rad_s2"
[[equation.effects]]
id = "friction.viscous"
channels.speed = "crank_velocity_rad_s"
[[equation.effects]]
id = "friction.coulomb"
channels.speed = "crank_velocity_rad_s"
[[equation.effects]]
id = "sensor.offset"
"""
PAYLOADS_KG = (0.0, 2.0, 5.0)
Extra = Callable[[FloatArray, float, float], FloatArray]
"""Speed, payload and temperature to a torque."""


def diagnosed(extra: Extra, *, together: bool = False) -> Diagnosis:
    """Return the diagnosis of runs with payloads and temperatures, which may rise together."""
    random, runs = np.random.default_rng(1), []
    for k, run in enumerate(turning()):
        payload = PAYLOADS_KG[k % 3]
        warmth = 296.0 + (3.0 * payload if together else random.uniform(0.0, 15.0))
        speed = np.gradient(run["crank_angle_rad"]) * RATE_HZ
        torque = run["crank_torque_n_m"] + extra(speed, payload, warmth)
        columns = {"crank_torque_n_m": torque, "crank_temperature_k": np.full(len(run), warmth)}
        runs.append(replace(run, conditions={"payload_kg": payload}).with_columns(**columns))
    models = declared(plant_file.parse(AXIS.replace("DRIVE", "crank_torque_n_m") + WARM))
    return diagnose(runs, list(models), split(runs))


def of_payload(speed: FloatArray, payload_kg: float, _: float) -> FloatArray:
    return 0.03 * payload_kg * np.tanh(speed / 0.02)


def test_friction_that_follows_a_stated_condition_is_named_with_the_condition() -> None:
    (finding,) = diagnosed(of_payload).findings
    assert (finding.verdict, finding.family) == ("identified", "friction.condition")
    assert {*finding.depends_on} == {"velocity_sign", "payload_kg"}
    assert finding.parameters["slope"].value == pytest.approx(0.03, rel=0.1)


def test_an_inertia_that_follows_a_payload_is_named_with_the_payload() -> None:
    def swung(speed: FloatArray, payload_kg: float, _: float) -> FloatArray:
        return np.asarray(0.004 * payload_kg * np.gradient(speed) * RATE_HZ)

    (finding,) = diagnosed(swung).findings
    assert (finding.verdict, finding.family) == ("identified", "inertia.condition")
    assert {*finding.depends_on} == {"acceleration", "payload_kg"}
    assert finding.parameters["slope"].value == pytest.approx(0.004, rel=0.1)


def test_a_gain_that_follows_a_supply_voltage_is_named_with_the_voltage() -> None:
    """A command is a share of the supply, which the machine file does not have."""
    runs = []
    for k, run in enumerate(turning()):
        supply_v = (10.5, 11.4, 12.3)[k % 3]
        random = np.random.default_rng(k)
        command = run["crank_torque_n_m"] / (0.1 * supply_v) + random.normal(0, 2e-3, len(run))
        known = replace(run, conditions={"supply_voltage_v": supply_v})
        runs.append(known.with_columns(crank_duty_ratio=command))
    models = declared(plant_file.parse(AXIS.replace("DRIVE", "crank_duty_ratio")))
    (finding,) = diagnose(runs, list(models), split(runs)).findings
    assert (finding.verdict, finding.family) == ("identified", "motor.condition")
    assert {*finding.depends_on} == {"current", "supply_voltage_v"}


def test_a_condition_and_a_temperature_that_rise_together_are_not_distinguished() -> None:
    (finding,) = diagnosed(of_payload, together=True).findings
    named = {finding.family, *finding.alternatives}
    assert (finding.verdict, named) == ("one_of", {"friction.condition", "friction.warmup"})


def test_nothing_is_found_in_runs_of_several_payloads_and_temperatures() -> None:
    assert diagnosed(lambda speed, *_: 0.0 * speed, together=True).findings == ()


@pytest.mark.parametrize("of_gain", [False, True])
def test_a_reading_that_follows_the_temperature_is_named(of_gain: bool) -> None:
    runs = []
    for k, run in enumerate(hoisted()):
        warm = 12.0 * np.sin(1.7 * k)
        error = 0.003 * warm * run["rope_force_n"] if of_gain else 2.0 * warm
        columns = {"rope_force_n": run["rope_force_n"] + error}
        temperature = np.full(len(run), 298.0 + warm)
        runs.append(run.with_columns(rope_temperature_k=temperature, **columns))
    (model,) = declared(plant_file.parse(HOIST + WARM.replace("crank", "rope")))
    (finding,) = diagnose(runs, [model], split(runs)).findings
    assert finding.family == "sensor.thermal"
    assert "temperature" in finding.depends_on


@pytest.mark.parametrize("since_s", [3.1, 4.45])
def test_the_instant_of_a_jump_is_found(since_s: float) -> None:
    runs = [
        run.with_columns(crank_torque_n_m=run["crank_torque_n_m"] + 0.2 * (run.time_s >= since_s))
        for run in turning()
    ]
    (finding,) = diagnose(runs, [axis()], split(runs)).findings
    assert finding.family == "change.step"
    assert finding.parameters["since"].value == pytest.approx(since_s, abs=0.05)


def test_a_constant_force_that_drifts_is_found_where_the_drive_is_the_target() -> None:
    runs = [
        run.with_columns(crank_current_a=run["crank_torque_n_m"] + 0.05 * run.time_s)
        for run in turning()
    ]
    (finding,) = diagnose(runs, [axis("crank_current_a")], split(runs)).findings
    assert finding.family == "sensor.drift"


def test_the_second_drive_of_an_axis_is_a_place() -> None:
    second = '[[actuator]]\nname = "other_drive_v"\naxis = "crank"\n'
    (model,) = declared(plant_file.parse(AXIS.replace("DRIVE", "crank_drive_v") + second))
    random, runs = np.random.default_rng(0), []
    for run in turning():
        other = 0.4 * np.sin(random.uniform(0.5, 2.0) * run.time_s + random.uniform(0.0, 6.0))
        driven = other - 0.9 * other**3
        drive = run["crank_torque_n_m"] - driven
        runs.append(run.with_columns(crank_drive_v=drive, other_drive_v=other))
    (finding, *_) = diagnose(runs, [model], split(runs)).findings
    assert "motor.saturation" in {finding.family, *finding.alternatives}
    assert "other_drive_v" in finding.place


def test_a_formula_in_the_unit_of_a_position_is_no_angle_of_a_wave() -> None:
    runs = []
    for k, run in enumerate(turning()):
        angle = run["crank_angle_rad"]
        scaled = PAYLOADS_KG[k % 3] * angle
        acceleration = np.gradient(np.gradient(scaled)) * RATE_HZ**2
        speed = np.gradient(angle) * RATE_HZ
        torque = run["crank_torque_n_m"] + 0.01 * acceleration
        torque += 0.04 * PAYLOADS_KG[k % 3] * np.tanh(speed / 0.02)
        runs.append(run.with_columns(crank_torque_n_m=torque, scaled_angle_rad=scaled))
    text = AXIS.replace("DRIVE", "crank_torque_n_m") + SCALED
    (model,) = (m for m in declared(plant_file.parse(text)) if m.balance == "drive")
    for finding in diagnose(runs, [model], split(runs)).findings:
        assert not {name for name in finding.depends_on if name.startswith("scaled")}


def test_a_condition_that_another_run_does_not_state_is_the_mean_one() -> None:
    runs = [replace(run, conditions={"payload_kg": k % 3}) for k, run in enumerate(turning())]
    layout = lay_out([axis()], runs, [run.name for run in runs])
    assert layout.conditions == ("payload_kg",)
    (planned,) = laid_out_like(layout, [replace(runs[0], conditions={})]).runs
    assert planned.channels["payload_kg"] == pytest.approx(0.9)


def test_a_condition_in_a_unit_of_motion_is_not_a_channel() -> None:
    stated = {"speed_m_s": 0.3, "amplitude_rad": 0.2, "payload_kg": 1.0, "gripper": 2.0}
    (run,) = prepared([replace(turning()[0], conditions=stated)])
    assert stated.keys() & run.columns.keys() == {"payload_kg"}
