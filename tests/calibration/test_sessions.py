"""Conclusions of guided calibrations from made-up measurements: found values and refusals."""

import numpy as np
import pytest

from calibration.fsr import Creep, FsrRun
from calibration.fsr_curve import FsrCurve
from calibration.fsr_memory import FsrMemory, fit_memory
from calibration.linear import shipped_calibration_set
from calibration.procedure import AbortedError, Measurement, carry_out
from calibration.quality import BadDataError
from calibration.regression import is_better, regress
from calibration.sessions.encoder import EncoderSession
from calibration.sessions.ft import AXES, FtSession, at_point, fit_tool
from calibration.sessions.gearbox import GearboxSession
from calibration.sessions.torque import TorqueSession
from estimation.recording import Flag, Recording

LINES = shipped_calibration_set("reference")


def readings(step, counts, flags=0):
    n = len(counts)
    recording = Recording(
        step.name,
        np.arange(n) * 1e-3,
        {"proximal_torque_n_m": counts * 1e-5},
        flags=np.full(n, flags, np.uint8),
        conditions=step.conditions,
    )
    raw = np.zeros(n, [("proximal", "i4")])
    raw["proximal"] = np.round(counts)
    return Measurement(recording, raw)


def weighed(session, gain=25_000.0, bend=0.0, shunt_gain=1.0):
    rng = np.random.default_rng(1)
    measured = []
    for step in session.steps():
        if "shunt_ratio" in step.conditions:
            level = 4000.0 * shunt_gain * step.conditions["shunt_ratio"]
        else:
            torque = step.conditions["mass_kg"] * 9.80665 * step.conditions["arm_m"]
            level = gain * torque * (1 + bend * torque)
        measured.append(readings(step, 100 + level + rng.normal(0, 3, 500)))
    return measured


def test_weights_give_the_line_of_a_torque_sensor():
    session = TorqueSession(shunt_v_v=1e-3, counts_per_v_v=4e6)
    concluded = session.conclude(weighed(session), LINES)
    (result,) = concluded.results
    assert result.fit.parameters["slope"] == pytest.approx(4e-5, rel=1e-3)
    assert result.fit.parameters["zero"] == pytest.approx(100, abs=1)
    assert abs(concluded.found["shunt_deviation_ratio"]) < 1e-3


@pytest.mark.parametrize(
    ("change", "rule"), [({"bend": 1.0}, "not_linear"), ({"shunt_gain": 1.03}, "shunt")]
)
def test_a_torque_sensor_that_is_not_right_is_refused(change, rule):
    session = TorqueSession(shunt_v_v=1e-3, counts_per_v_v=4e6)
    with pytest.raises(BadDataError) as refused:
        session.conclude(weighed(session, **change), LINES)
    assert refused.value.rule == rule


class Scripted:
    """An operator and bench that can stop, or saturate, at one step."""

    def __init__(self, stop_at=None, saturate_at=None):
        self.stop_at, self.saturate_at, self.measured = stop_at, saturate_at, []

    def prepare(self, step):
        if step.name == self.stop_at:
            raise AbortedError("stopped")

    def measure(self, step):
        self.measured.append(step.name)
        flag = Flag.SATURATED if step.name == self.saturate_at else 0
        return readings(step, np.arange(200.0), int(flag))


def test_steps_come_in_order_and_an_abort_ends_them():
    names = [step.name for step in TorqueSession().steps()]
    whole = Scripted()
    assert len(carry_out(TorqueSession(), whole, whole)) == len(names)
    assert whole.measured == names
    stopped = Scripted(stop_at=names[3])
    with pytest.raises(AbortedError):
        carry_out(TorqueSession(), stopped, stopped)
    assert stopped.measured == names[:3]


def test_a_saturated_step_ends_the_session_with_the_reason():
    bench = Scripted(saturate_at="02-100g")
    with pytest.raises(BadDataError) as refused:
        carry_out(TorqueSession(), bench, bench)
    assert refused.value.rule == "saturated"


def test_loads_of_one_sign_show_no_backlash():
    session = GearboxSession(loads_a=(0.5, 0.9))
    measured = [readings(step, np.arange(200.0)) for step in session.steps()]
    with pytest.raises(BadDataError) as refused:
        session.conclude(measured, LINES)
    assert refused.value.rule == "levels"


def test_a_mark_found_in_different_places_is_refused():
    session = EncoderSession()
    measured = []
    for k, step in enumerate(session.steps()):
        counts = np.zeros(100, [("spindle", "i4")])
        counts["spindle"] = 1000 + 20 * k
        measured.append(Measurement(readings(step, np.arange(100.0)).recording, counts))
    with pytest.raises(BadDataError) as refused:
        session.conclude(measured, LINES)
    assert refused.value.rule == "not_steady"


BIAS = np.array([3.0, -2.0, 5.0, 0.04, -0.03, 0.01])
CENTRE = np.array([0.004, -0.002, 0.031])


def poses(mass=0.2, noise=1e-3, seed=0):
    rng = np.random.default_rng(seed)
    down = np.array([step.conditions[f"gravity_{a}_ratio"] for step in FtSession().steps()
                     for a in "xyz"]).reshape(-1, 3)  # fmt: skip
    force = mass * 9.80665 * down
    wrench = BIAS + np.hstack([force, np.cross(CENTRE, force)])
    return down, wrench + rng.normal(0, noise, wrench.shape) * [1, 1, 1, 0.03, 0.03, 0.03]


def test_poses_give_bias_mass_and_centre_of_mass():
    fit = fit_tool(*poses()).fit
    truth = {f"bias_{axis}": value for axis, value in zip(AXES, BIAS, strict=True)}
    truth |= {f"centre_{k}_m": value for k, value in zip("xyz", CENTRE, strict=True)}
    error = [value - (truth | {"mass_kg": 0.2})[name] for name, value in fit.parameters.items()]
    assert (np.abs(error) < 5 * np.sqrt(np.diag(fit.covariance))).all()
    down, wrench = poses(noise=0.0)
    np.testing.assert_allclose(fit_tool(down, wrench).contact(wrench, down), 0, atol=1e-9)


@pytest.mark.parametrize(
    ("spoil", "rule"),
    [
        (lambda down, read: (down[:4], read[:4]), "points"),
        (lambda down, read: (down, np.tile(BIAS, (len(down), 1))), "no_change"),
        (lambda down, read: (-down, read), "no_change"),
        (lambda down, read: (down[[0, 1, 2, 3] * 2], read[[0, 1, 2, 3] * 2]), "levels"),
        (lambda down, read: (down, read + np.eye(len(down), 6)), "not_linear"),
    ],
)
def test_insufficient_poses_are_refused(spoil, rule):
    with pytest.raises(BadDataError) as refused:
        fit_tool(*spoil(*poses()))
    assert refused.value.rule == rule


def test_a_force_at_the_jaw_has_no_torque_about_the_jaw():
    jaw, force = np.array([0.01, 0.02, 0.3]), np.array([1.0, -2.0, 0.5])
    at_sensor = np.concatenate([force, np.cross(jaw, force)])
    np.testing.assert_allclose(at_point(at_sensor, jaw), [*force, 0, 0, 0], atol=1e-12)


def test_a_regression_takes_runs_as_evidence():
    rng = np.random.default_rng(0)
    runs = []
    for _ in range(12):
        x = np.column_stack([rng.uniform(-1, 1, 300), np.ones(300)])
        runs.append((x, x @ [2.0, 0.1] + rng.normal(0, 0.1) + rng.normal(0, 0.01, 300)))
    fit = regress(runs)
    # the offsets differ from run to run by ten times the noise: 0.1 / sqrt(12), not 0.01 / 60
    assert np.sqrt(fit.covariance[1, 1]) == pytest.approx(0.1 / np.sqrt(12), rel=0.5)
    useless = [(np.column_stack([x, rng.normal(size=300)]), y) for x, y in runs]
    assert not is_better(regress(useless).held_out, fit.held_out)
    assert is_better(fit.held_out, regress([(x[:, 1:], y) for x, y in runs]).held_out)


def pressed(k, gap=0.0, creep=0.0, memory_noise=0.002):
    rng = np.random.default_rng(k)
    t = np.arange(0, 8, 0.02)
    volts = 0.05 + 0.9 * rng.uniform(0.97, 1.0) * np.sin(np.pi * t / 8) ** 2
    curve = FsrCurve((0.1, 1.5), 0.04, 0.96)
    force = FsrMemory(gap_n=gap).force_n(curve, t, volts) + rng.normal(0, memory_noise, t.size)
    return curve, FsrRun(f"press-{k}", t, volts, force)


@pytest.mark.parametrize("gap", [0.0, 0.1, -0.05])
def test_the_gap_of_loading_and_unloading_is_found_where_there_is_one(gap):
    curve, _ = pressed(0)
    memory = fit_memory(curve, [pressed(k, gap)[1] for k in range(6)], None)
    assert memory.gap_n == pytest.approx(gap, abs=0.002)


def test_creep_is_removed_only_where_it_is_significant():
    curve, _ = pressed(0)
    sure = fit_memory(curve, [pressed(k)[1] for k in range(4)], Creep(0.02, 1e-4))
    unsure = fit_memory(curve, [pressed(k)[1] for k in range(4)], Creep(0.02, 0.02))
    assert (sure.creep_ratio, unsure.creep_ratio) == (0.02, 0.0)
    held = np.full(1000, 0.5)
    time_s = np.arange(1000) * 0.01
    decades = np.log10(np.maximum(time_s, 0.1) / 0.1)
    off = sure.without_creep(curve, time_s, held * (1 + 0.02 * decades))
    np.testing.assert_allclose(off, 0.5, rtol=1e-12)
