"""Equations that the owner of a machine states: what their target's own sensor adds to them."""

from dataclasses import replace

import numpy as np
import pytest

from estimation import plant_file
from estimation.causes.verdict import diagnose
from estimation.diagnosis.split import split
from estimation.model import Model
from estimation.plant_models import declared
from estimation.recording import FloatArray, Recording
from tests.estimation.causes.synthetic import axis, turning

DYNO = """
schema = "rig.machine/1"
machine = { name = "dyno", cutoff_hz = 8.0 }
axis = [{ name = "roller", unit = "rad" }]
sensor = [
  { name = "roller_angle_rad", axis = "roller", reads = "position" },
  { name = "hub_torque_n_m" },
  { name = "brake_current_a" },
]
[[equation]]
name = "hub"
target = "hub_torque_n_m"
effects = [
  { id = "motor.torque_constant", channels = { source = "brake_current_a" } },
  { id = "inertia.missing", channels = { acceleration = "roller_acceleration_rad_s2" } },
  { id = "friction.viscous", channels = { speed = "roller_velocity_rad_s" } },
  { id = "spring.position", channels = { position = "roller_angle_rad" } },
  { id = "sensor.offset" },
]
"""
RATE_HZ, SECONDS, RUNS = 100.0, 12.0, 9


def hub() -> Model:
    (model,) = declared(plant_file.parse(DYNO))
    return model


def driven(
    late_s: float = 0.0, flattening: float = 0.0, angle_late_s: float = 0.0
) -> list[Recording]:
    """Return runs of a roller whose torque is mostly that of its inertia.

    Args:
        late_s: Age of the torque's reading.
        flattening: Share by which the torque's sensor reads too little, for each N m.
        angle_late_s: Age of the angle's reading.
    """
    random = np.random.default_rng(0)
    time = np.arange(-0.5, SECONDS, 1.0 / RATE_HZ)
    kept = time >= 0.0
    out = []
    for k in range(RUNS):
        angle, current = (_waves(random, time, most_hz, 5) for most_hz in (1.2, 0.8))
        speed = np.gradient(angle, time)
        torque = 1.2 * np.gradient(speed, time) + 0.4 * speed + 9.0 * angle + 9.0 * current
        torque = np.interp(time - late_s, time, torque)
        torque = torque - flattening * torque * np.abs(torque)
        columns = {
            "roller_angle_rad": np.interp(time - angle_late_s, time, angle),
            "brake_current_a": current + random.normal(0, 0.005, len(time)),
            "hub_torque_n_m": torque + random.normal(0, 0.05, len(time)),
        }
        columns = {name: values[kept] for name, values in columns.items()}
        start = int(2e10 * k) + 1
        out.append(Recording(f"{k:02d}", time[kept], columns, started_at_ns=start))
    return out


def _waves(random: np.random.Generator, time: FloatArray, most_hz: float, count: int) -> FloatArray:
    waves = zip(
        random.uniform(0.1, most_hz, count), random.uniform(0, 2 * np.pi, count), strict=True
    )
    return np.asarray(sum(np.sin(2 * np.pi * f * time + p) for f, p in waves))


def test_two_terms_of_one_effect_have_a_name_each_in_what_moved() -> None:
    second = '{ id = "motor.torque_constant", channels = { source = "fan_current_a" } },\n  '
    before, found, after = DYNO.partition('{ id = "sensor.offset" }')
    (model,) = declared(plant_file.parse(before + second + found + after))
    random = np.random.default_rng(1)
    runs = []
    for run in driven():
        fan = np.cumsum(random.normal(0, 0.05, len(run.time_s)))
        torque = run["hub_torque_n_m"] + 3.0 * fan
        runs.append(run.with_columns(fan_current_a=fan, hub_torque_n_m=torque))
    moved = diagnose(runs, [model], split(runs)).moved["hub"]
    sizes = {name: value["before"] for name, value in moved.items()}
    assert sizes["motor.torque_constant(brake_current_a).gain"] == pytest.approx(9.0, rel=0.02)
    assert sizes["motor.torque_constant(fan_current_a).gain"] == pytest.approx(3.0, rel=0.02)
    assert "inertia.missing.inertia" in sizes


def test_a_second_current_of_an_equation_has_a_drive_of_its_own() -> None:
    second = '{ id = "motor.torque_constant", channels = { source = "fan_current_a" } },\n  '
    before, found, after = DYNO.partition('{ id = "sensor.offset" }')
    models = declared(plant_file.parse(before + second + found + after))
    random, runs = np.random.default_rng(1), []
    for run in driven():
        fan = _waves(random, run.time_s, 0.8, 5)
        torque = run["hub_torque_n_m"] + 3.0 * (fan - 0.06 * fan * np.abs(fan))
        runs.append(run.with_columns(fan_current_a=fan, hub_torque_n_m=torque))
    (finding,) = diagnose(runs, models, split(runs)).findings
    assert finding.place == "actuator fan_current_a"
    assert "motor.saturation" in (finding.family, *finding.alternatives)


@pytest.mark.parametrize(
    ("fault", "channel", "family"),
    [
        ({"late_s": 0.04}, "hub_torque_n_m", "sensor.delay"),
        ({"flattening": 0.001}, "hub_torque_n_m", "sensor.gain_nonlinear"),
        ({"angle_late_s": 0.04}, "roller_angle_rad", "sensor.delay"),
    ],
)
def test_what_a_sensor_adds_lowers_the_error(fault, channel, family):
    runs = driven(**fault)
    (finding,) = diagnose(runs, [hub()], split(runs)).findings
    assert finding.place == f"sensor {channel}"
    assert family in (finding.family, *finding.alternatives)
    assert finding.rmse_after < 0.4 * finding.rmse_before


def test_the_onset_of_a_stop_is_that_of_the_least_error() -> None:
    runs = turning(lambda angle, speed, acceleration: 0.6 * np.maximum(angle - 0.37, 0.0))
    (finding,) = diagnose(runs, [axis()], split(runs)).findings
    onset, stiffness = (finding.parameters[name] for name in ("onset", "stiffness"))
    assert finding.family == "spring.end_stop"
    assert onset.value == pytest.approx(0.37, abs=0.01)
    assert stiffness.value == pytest.approx(0.6, rel=0.02)
    assert onset.ci95[0] < onset.value < onset.ci95[1]


def test_a_late_reading_is_late_as_a_whole() -> None:
    runs = driven(late_s=0.02)
    (finding,) = diagnose(runs, [hub()], split(runs)).findings
    assert finding.parameters["gain"].value == pytest.approx(1.0, abs=0.1)
    time = next(p for name, p in finding.parameters.items() if name in ("delay", "time_constant"))
    assert time.value == pytest.approx(0.02, rel=0.1)


TWIN = """
schema = "rig.machine/1"
machine = { name = "twin", cutoff_hz = 8.0 }
axis = [{ name = "roller", unit = "rad" }]
sensor = [
  { name = "roller_angle_rad", axis = "roller", reads = "position" },
  { name = "left_torque_n_m" },
  { name = "right_torque_n_m" },
  { name = "drive_current_a" },
]
[[equation]]
name = "left"
target = "left_torque_n_m"
effects = [
  { id = "motor.torque_constant", channels = { source = "drive_current_a" } },
  { id = "inertia.missing", channels = { acceleration = "roller_acceleration_rad_s2" } },
  { id = "sensor.offset" },
]
[[equation]]
name = "right"
target = "right_torque_n_m"
effects = [
  { id = "motor.torque_constant", channels = { source = "drive_current_a" } },
  { id = "friction.viscous", channels = { speed = "roller_velocity_rad_s" } },
  { id = "sensor.offset" },
]
"""


def test_a_fault_of_one_drive_enters_both_equations_that_read_its_current() -> None:
    random, runs = np.random.default_rng(2), []
    for run in driven():
        time, current = run.time_s, run["brake_current_a"]
        speed = np.gradient(run["roller_angle_rad"], time)
        force = current - 0.08 * current * np.abs(current)
        noise = random.normal(0, 0.01, (2, len(time)))
        columns = {
            "roller_angle_rad": run["roller_angle_rad"],
            "drive_current_a": current,
            "left_torque_n_m": 4.0 * force + 0.1 * np.gradient(speed, time) + noise[0],
            "right_torque_n_m": 2.0 * force + 0.3 * speed + noise[1],
        }
        runs.append(Recording(run.name, time, columns, started_at_ns=run.started_at_ns))
    (finding,) = diagnose(runs, declared(plant_file.parse(TWIN)), split(runs)).findings
    assert finding.place == "actuator drive_current_a"
    assert {finding.balance, *finding.also_in} == {"left", "right"}
    assert "motor.saturation" in (finding.family, *finding.alternatives)


PUMP = """
schema = "rig.machine/1"
machine = { name = "pump", cutoff_hz = 5.0 }
axis = [{ name = "pump", unit = "rad" }]
sensor = [
  { name = "pump_velocity_rad_s", axis = "pump", reads = "speed" },
  { name = "pipe_m_s" },
  { name = "suction_pa" },
  { name = "head_pa" },
]
[[equation]]
name = "head"
target = "head_pa"
effects = [
  { id = "transmission.ratio", channels = { load = "suction_pa" } },
  { id = "friction.drag", sign = -1, channels = { speed = "pipe_m_s" } },
  { id = "sensor.offset" },
]
"""


def pumped(mixed: float) -> list[Recording]:
    """Return runs of a pump whose head has a term of two of its readings."""
    random, out = np.random.default_rng(0), []
    time = np.arange(0.0, SECONDS, 1.0 / RATE_HZ)
    for k in range(12):
        flow, suction = (2.0 + 0.5 * _waves(random, time, 0.5, 4) for _ in range(2))
        speed = 10.0 + _waves(random, time, 0.5, 4)
        head = 3.0 * suction - 0.8 * flow * np.abs(flow) + mixed * flow * suction
        columns = {
            "pump_angle_rad": np.cumsum(speed) / RATE_HZ,
            "pipe_m_s": flow + random.normal(0, 0.003, len(time)),
            "suction_pa": suction + random.normal(0, 0.003, len(time)),
            "head_pa": head + random.normal(0, 0.02, len(time)),
        }
        out.append(Recording(f"{k:02d}", time, columns, started_at_ns=int(2e10 * k) + 1))
    return out


def test_a_term_of_two_readings_that_an_equation_declares_depends_on_both() -> None:
    (model,) = declared(plant_file.parse(PUMP))
    runs = pumped(mixed=0.5)
    (finding,) = diagnose(runs, [model], split(runs)).findings
    assert finding.verdict == "depends_on"
    assert {*finding.depends_on} == {"suction_pa", "pipe"}
    assert finding.rmse_after < 0.5 * finding.rmse_before
    assert not diagnose(pumped(mixed=0.0), [model], split(runs)).findings


def test_a_zero_that_drifts_is_named_where_a_shaft_turns_one_way() -> None:
    runs = []
    for k, run in enumerate(driven()):
        speed = 9.0 + 0.5 * (k % 3)
        ahead = run["roller_angle_rad"] + speed * run.time_s
        torque = run["hub_torque_n_m"] - 9.0 * run["roller_angle_rad"] + 0.3 * run.time_s
        columns = {"roller_angle_rad": ahead, "hub_torque_n_m": torque + 0.4 * speed}
        runs.append(run.with_columns(**columns))
    model = hub()
    model = replace(model, terms=tuple(t for t in model.terms if t.effect.id != "spring.position"))
    (finding,) = diagnose(runs, [model], split(runs)).findings
    assert finding.family == "sensor.drift"
    assert finding.rmse_after < 0.1 * finding.rmse_before
