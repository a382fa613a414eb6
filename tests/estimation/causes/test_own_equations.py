"""Equations that the owner of a machine states: what their target's own sensor adds to them."""

import numpy as np
import pytest

from estimation import plant_file
from estimation.causes.verdict import diagnose
from estimation.diagnosis.split import split
from estimation.model import Model
from estimation.plant_models import declared
from estimation.recording import FloatArray, Recording

DYNO = """
schema = "rig.machine/1"
[machine]
name = "dyno"
cutoff_hz = 8.0
[[axis]]
name = "roller"
unit = "rad"
[[sensor]]
name = "roller_angle_rad"
axis = "roller"
reads = "position"
[[sensor]]
name = "hub_torque_n_m"
[[sensor]]
name = "brake_current_a"
[[equation]]
name = "hub"
target = "hub_torque_n_m"
[[equation.effects]]
id = "motor.torque_constant"
channels.source = "brake_current_a"
[[equation.effects]]
id = "inertia.missing"
channels.acceleration = "roller_acceleration_rad_s2"
[[equation.effects]]
id = "friction.viscous"
channels.speed = "roller_velocity_rad_s"
[[equation.effects]]
id = "spring.position"
channels.position = "roller_angle_rad"
[[equation.effects]]
id = "sensor.offset"
"""
RATE_HZ, SECONDS, RUNS = 100.0, 12.0, 9


def hub() -> Model:
    """Return the equation of `DYNO`."""
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


@pytest.mark.parametrize(
    ("fault", "channel", "family"),
    [
        ({"late_s": 0.04}, "hub_torque_n_m", "sensor.delay"),
        ({"flattening": 0.001}, "hub_torque_n_m", "sensor.gain_nonlinear"),
        ({"angle_late_s": 0.04}, "roller_angle_rad", "sensor.delay"),
    ],
)
def test_what_a_sensor_adds_lowers_the_error(
    fault: dict[str, float], channel: str, family: str
) -> None:
    runs = driven(**fault)
    (finding,) = diagnose(runs, [hub()], split(runs)).findings
    assert finding.place == f"sensor {channel}"
    assert family in (finding.family, *finding.alternatives)
    assert finding.rmse_after < 0.4 * finding.rmse_before
