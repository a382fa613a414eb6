"""Friction that depends on the standstill before it, in a form that no equation has."""

import numpy as np
import pytest
from scipy import signal

from estimation.causes.verdict import diagnose
from estimation.diagnosis.split import split
from estimation.effects import effect
from estimation.recording import FloatArray, Recording
from tests.estimation.causes.synthetic import axis, turning

RATE_HZ, SECONDS = 250.0, 10.0


def with_rests(extra_n_m: float, age_s: float, way_rad: float) -> list[Recording]:
    """Return runs that rest now and then, with friction that grows after rests of some length."""
    random = np.random.default_rng(0)
    time, out = np.arange(int(RATE_HZ * SECONDS)) / RATE_HZ, list[Recording]()
    for k in range(12):
        speed, at = np.zeros(len(time)), 0
        while at < len(time):  # moves and rests in turn
            stop = at + int(RATE_HZ * random.uniform(0.3, 0.9))
            speed[at:stop] = random.choice([-1.0, 1.0]) * random.uniform(0.4, 3.0)
            at = stop + int(RATE_HZ * random.choice([0.1, 0.3, 0.8, 1.6]))
        speed = signal.sosfiltfilt(signal.butter(2, 6.0, fs=RATE_HZ, output="sos"), speed)
        roles = {"speed": np.abs(speed), "clock": time}
        contact = effect("friction.dwell").columns(roles, (age_s, way_rad, 1e-9))[:, 0]
        window = np.exp(-(((contact - 0.55) / 0.12) ** 2))
        torque = 0.02 * np.gradient(speed, time) + 0.05 * speed + 0.3 * np.tanh(speed / 0.05)
        torque += extra_n_m * window * np.tanh(speed / 0.05) + random.normal(0, 0.01, len(time))
        columns = {"crank_torque_n_m": torque, "crank_angle_rad": np.cumsum(speed) / RATE_HZ}
        out.append(Recording(f"{k:02d}", time, columns, started_at_ns=int(2e10 * k) + 1))
    return out


@pytest.mark.parametrize(("age_s", "way_rad"), [(0.7, 0.15), (1.5, 0.6)])
def test_friction_after_rests_of_some_length_depends_on_dwell(age_s: float, way_rad: float) -> None:
    runs = with_rests(0.2, age_s, way_rad)
    found = diagnose(runs, [axis()], split(runs))
    (finding,) = found.findings
    assert (finding.verdict, {*finding.depends_on}) == ("depends_on", {"dwell", "velocity_sign"})


def test_nothing_depends_on_dwell_where_no_run_rests() -> None:
    time, runs = np.arange(int(RATE_HZ * SECONDS)) / RATE_HZ, []
    for k in range(12):
        speed = 1.0 + 0.5 * np.sin((0.5 + 0.1 * k) * time)
        extra = 0.3 * np.exp(-(((speed - 0.8) / 0.1) ** 2))
        torque = 0.02 * np.gradient(speed, time) + 0.05 * speed + 0.3 + extra
        torque += np.random.default_rng(k).normal(0, 0.01, len(time))
        columns = {"crank_torque_n_m": torque, "crank_angle_rad": np.cumsum(speed) / RATE_HZ}
        runs.append(Recording(f"{k:02d}", time, columns, started_at_ns=int(2e10 * k) + 1))
    findings = diagnose(runs, [axis()], split(runs)).findings
    assert findings
    assert not [f for f in findings if "dwell" in f.depends_on or f.family == "friction.dwell"]


@pytest.mark.parametrize("at_rad_s", [0.3, 0.8])
def test_a_curve_over_speed_does_not_depend_on_dwell(at_rad_s: float) -> None:
    def extra(_: FloatArray, speed: FloatArray, __: FloatArray) -> FloatArray:
        return 0.1 * np.exp(-(((np.abs(speed) - at_rad_s) / 0.12) ** 2)) * np.tanh(speed / 0.02)

    runs = turning(extra)
    (finding,) = diagnose(runs, [axis()], split(runs)).findings
    assert "dwell" not in finding.depends_on
