"""Conclusions of guided calibrations from made-up measurements: found values and refusals."""

import numpy as np
import pytest

from calibration.fsr import Creep, FsrRun
from calibration.fsr_curve import FsrCurve
from calibration.fsr_memory import FsrMemory, fit_memory
from calibration.linear import shipped_calibration_set
from calibration.procedure import Measurement, carry_out
from calibration.quality import BadDataError
from calibration.regression import is_better, regress
from calibration.sessions.encoder import EncoderSession
from calibration.sessions.ft import AXES, FtSession, at_point, fit_tool
from calibration.sessions.gearbox import GearboxSession
from calibration.sessions.torque import TorqueSession
from estimation.recording import Flag, Recording

LINES = shipped_calibration_set("reference")
RNG = np.random.default_rng


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


def test_weights_give_the_line_of_a_torque_sensor():
    session, rng, measured = TorqueSession(shunt_v_v=1e-3, counts_per_v_v=4e6), RNG(1), []
    for step in session.steps():
        said = step.conditions
        torque = said.get("mass_kg", 0.0) * 9.80665 * said.get("arm_m", 0.0)
        level = 100 + 25_000.0 * torque + 4000.0 * said.get("shunt_ratio", 0.0)
        measured.append(readings(step, level + rng.normal(0, 3, 500)))
    concluded = session.conclude(measured, LINES)
    (result,) = concluded.results
    assert result.fit.parameters["slope"] == pytest.approx(4e-5, rel=1e-3)
    assert result.fit.parameters["zero"] == pytest.approx(100, abs=1)
    assert abs(concluded.found["shunt_deviation_ratio"]) < 1e-3


class Scripted:
    """An operator and bench whose converter saturates at one step."""

    def __init__(self, saturate_at=None):
        self.saturate_at, self.measured = saturate_at, []

    def prepare(self, step):
        pass

    def measure(self, step):
        self.measured.append(step.name)
        flag = Flag.SATURATED if step.name == self.saturate_at else 0
        return readings(step, np.arange(200.0), int(flag))


def test_steps_come_in_order_and_a_saturated_one_ends_them_with_the_reason():
    names = [step.name for step in TorqueSession().steps()]
    whole, bad = Scripted(), Scripted(saturate_at=names[2])
    assert len(carry_out(TorqueSession(), whole, whole)) == len(names)
    assert whole.measured == names
    with pytest.raises(BadDataError) as refused:
        carry_out(TorqueSession(), bad, bad)
    assert refused.value.rule == "saturated"
    assert bad.measured == names[:3]


@pytest.mark.parametrize(
    ("session", "rule"),
    [(GearboxSession(loads_a=(0.5, 0.9)), "levels"), (EncoderSession(), "not_steady")],
    ids=["loads of one sign", "a mark in different places"],
)
def test_what_shows_nothing_is_refused(session, rule):
    measured = []
    for k, step in enumerate(session.steps()):
        counts = np.full(200, 1000 + 20 * k, "i4").view([("spindle", "i4")])
        measured.append(Measurement(readings(step, np.arange(200.0)).recording, counts))
    with pytest.raises(BadDataError) as refused:
        session.conclude(measured, LINES)
    assert refused.value.rule == rule


BIAS = np.array([3.0, -2.0, 5.0, 0.04, -0.03, 0.01])
CENTRE = np.array([0.004, -0.002, 0.031])


def poses(noise=1e-3):
    down = np.array([list(step.conditions.values()) for step in FtSession().steps()])
    force = 0.2 * 9.80665 * down
    wrench = BIAS + np.hstack([force, np.cross(CENTRE, force)])
    return down, wrench + RNG(0).normal(0, noise, wrench.shape) * [1, 1, 1, 0.03, 0.03, 0.03]


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
    rng, runs = RNG(0), []
    for _ in range(12):
        x = np.column_stack([rng.uniform(-1, 1, 300), np.ones(300)])
        runs.append((x, x @ [2.0, 0.1] + rng.normal(0, 0.1) + rng.normal(0, 0.01, 300)))
    fit = regress(runs)
    # the offsets differ from run to run by ten times the noise: 0.1 / sqrt(12), not 0.01 / 60
    assert np.sqrt(fit.covariance[1, 1]) == pytest.approx(0.1 / np.sqrt(12), rel=0.5)
    useless = [(np.column_stack([x, rng.normal(size=300)]), y) for x, y in runs]
    assert not is_better(regress(useless).held_out, fit.held_out)
    assert is_better(fit.held_out, regress([(x[:, 1:], y) for x, y in runs]).held_out)


CURVE = FsrCurve((0.1, 1.5), 0.04, 0.96)


def remembered(gap, creep):
    t, runs = np.arange(0, 8, 0.02), []
    for k in range(6):
        volts = 0.05 + 0.9 * RNG(k).uniform(0.97, 1.0) * np.sin(np.pi * t / 8) ** 2
        force = FsrMemory(gap_n=gap).force_n(CURVE, t, volts) + RNG(k).normal(0, 0.002, t.size)
        runs.append(FsrRun(f"press-{k}", t, volts, force))
    return fit_memory(CURVE, runs, creep)


@pytest.mark.parametrize("gap", [0.0, 0.1, -0.05])
def test_the_gap_of_loading_and_unloading_is_found_where_there_is_one(gap):
    assert remembered(gap, None).gap_n == pytest.approx(gap, abs=0.002)


def test_creep_is_removed_only_where_it_is_significant():
    sure, unsure = remembered(0.0, Creep(0.02, 1e-4)), remembered(0.0, Creep(0.02, 0.02))
    assert (sure.creep_ratio, unsure.creep_ratio) == (0.02, 0.0)
    time_s = np.arange(1000) * 0.01
    decades = np.log10(np.maximum(time_s, 0.1) / 0.1)
    off = sure.without_creep(CURVE, time_s, 0.5 * (1 + 0.02 * decades))
    np.testing.assert_allclose(off, 0.5, rtol=1e-12)
