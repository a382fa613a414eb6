"""The paper's method and ours on one degree of freedom of a simulated grasper.

Runs that calibrate and runs that are reported are different runs. Where ours is fitted, objects
differ in stiffness and place from run to run: with one object the angle alone would give the force.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from scipy import ndimage

from estimation.campaign import Campaign
from estimation.causes.verdict import answer
from estimation.derived import CAMPAIGN_TIME
from estimation.diagnosis.split import split
from estimation.effects import effect
from estimation.filters import LowPass
from estimation.fitting import fit
from estimation.model import Model, Term, predict
from estimation.model_file import to_toml
from estimation.recording import FloatArray, Recording
from rig.grasper.current_force import CurrentForce, angle_led
from rig.grasper.hidden import OWN, with_family
from rig.grasper.plant import (
    RATE_HZ,
    AxisParameters,
    Prototype,
    end_of_hold,
    hold,
    periodic,
    play_axis,
    vary,
)

DOFS = ("grasp", "pitch", "yaw")
INPUTS = ("long", "short", "periodic")
LEVELS_N = (0.5, 1.0, 1.5, 2.0)
LONG_S, SHORT_S = 26.0, 2.0

PAPER_COEFFICIENTS: Mapping[str, float | None] = {"grasp": 1.28, "pitch": None, "yaw": 1.55}
"""One over Table 2; the pitch's is missing in our copy of the text."""
PAPER_ERRORS_N: Mapping[str, tuple[float, float, float]] = {
    "grasp": (0.24, 0.46, 0.49),
    "pitch": (0.14, 0.37, 0.71),
    "yaw": (-0.03, 0.07, 0.05),
}
"""Table 3, in the order of `INPUTS`."""
PAPER_DELAYS_MS: Mapping[str, float] = {"grasp": 0.0, "pitch": -20.0, "yaw": 0.0}
"""Table 4."""

FILTER = LowPass(cutoff_hz=25.0, order=2)
EVERY = 8
"""Samples that are averaged to one where a model is fitted or diagnosed."""

Axes = tuple[AxisParameters, ...]
ToForce = Callable[[Recording], FloatArray]
"""Run to estimated force, N, shape (n,)."""


@dataclass(frozen=True)
class Lacking:
    """The effects that the diagnosis finds missing in a degree of freedom's model."""

    findings: tuple[tuple[str, str], ...]
    model: str  # the declared model with the effects it named, and the signals they read, as TOML


@dataclass(frozen=True)
class Outcome:
    """One method on one degree of freedom of one grasper."""

    # estimate less force, mean over the levels, in the order of `INPUTS`
    errors_n: tuple[float, float, float]
    delay_ms: float  # of the estimate behind the force in periodic input; negative where it leads


def axes_of(prototype: Prototype, dof: str, seed: int, spread: float, family: str = OWN) -> Axes:
    """Return the axes of a degree of freedom of the grasper of this seed and hidden friction.

    Pitch and grasp share the first jaw.
    """
    first = 10 * seed + (5 if dof == "yaw" else 0)
    axes = (vary(axis, first + k, spread) for k, axis in enumerate(prototype.axes[dof]))
    return tuple(with_family(axis, family, first + k) for k, axis in enumerate(axes))


def record(
    name: str, dof: str, axes: Axes, target_rad: FloatArray, seed: int, **held: float
) -> Recording:
    """Return a run at 2 kHz: the mean current and angle of the axes, and the force as torque."""
    played = [play_axis(axis, target_rad, 100 * seed + k) for k, axis in enumerate(axes)]
    mean = {key: np.mean([one[key] for one in played], axis=0) for key in played[0]}
    return Recording(
        name,
        np.arange(len(target_rad)) / RATE_HZ,
        {
            f"{dof}_current_a": mean["motor_current_a"],
            f"{dof}_angle_rad": mean["joint_angle_rad"],
            f"{dof}_torque_n_m": mean["force_n"] * axes[0].arm_m,
        },
        conditions=held,
        rig="simulated grasper",
    )


def declared(dof: str) -> Model:
    """Return the paper's model as ours declares it: torque in proportion to current, and a zero."""
    current = {"source": f"{dof}_current_a"}
    terms = (Term(effect("motor.torque_constant"), 1, current), Term(effect("sensor.offset"), 1))
    return Model(
        "zhao",
        dof,
        f"{dof}_torque_n_m",
        terms,
        "Torque of a joint from its motor's current; Zhao and Nelson 2016, equations 12 to 14.",
        FILTER,
        run_offsets=False,
        counted="all",
    )


def calibration_runs(dof: str, axes: Axes, seed: int) -> list[Recording]:
    """Return two runs of each kind, on objects that differ in stiffness and place, at 250 Hz."""
    random = np.random.default_rng(seed + 77)
    runs: list[Recording] = []
    for repeat, force_n, (number, kind) in product(range(2), LEVELS_N, enumerate(INPUTS)):
        stiffness = float(np.exp(random.uniform(np.log(0.15), np.log(0.6))))
        held = on_object(axes, stiffness, float(random.uniform(0.05, 0.25)))
        target, run_seed = target_of(kind, held[0], force_n), seed * 1000 + len(runs)
        conditions = {"input_ratio": float(number), "force_n": force_n}
        run = record(f"{kind}-{force_n:g}N-{repeat}", dof, held, target, run_seed, **conditions)
        runs.append(_averaged(run))
    return runs


def on_object(axes: Axes, stiffness_n_m_rad: float, contact_rad: float) -> Axes:
    """Return axes that grasp an object of a stiffness from an angle on."""
    return tuple(
        replace(a, contact_n_m_rad=stiffness_n_m_rad, contact_rad=contact_rad) for a in axes
    )


def lacking(dof: str, axes: Axes, seed: int) -> Lacking:
    """Return the effects that the diagnosis identifies on a grasper's runs."""
    runs = calibration_runs(dof, axes, seed)
    model = declared(dof)
    # a diagnosis reads only channels that an equation declares: friction declares the motion
    rubs = Term(effect("friction.coulomb"), -1, {"speed": f"{dof}_velocity_rad_s"})
    model = replace(model, terms=(*model.terms, rubs))
    found = answer(runs, [model], split(runs, seed))
    (written,) = found.models
    # of another grasper's campaign: its time and its conditions state nothing elsewhere
    stated = {CAMPAIGN_TIME, *runs[0].conditions}
    of_any = (t for t in written.terms[len(model.terms) :] if not stated & {*t.channels.values()})
    terms = (*declared(dof).terms, *of_any)
    return Lacking(
        tuple((finding.family, finding.verdict) for finding in found.diagnosis.findings),
        to_toml(replace(written, terms=terms, evidence=None)),
    )


def fitted(dof: str, axes: Axes, seed: int, model: Model) -> Model:
    """Return a model fitted on this grasper's calibration runs."""
    return fit(model, Campaign.of(calibration_runs(dof, axes, seed)), bootstrap=0)


def of_model(model: Model, arm_m: float) -> ToForce:
    """Return the force by a model, causal as live, without the lag of its filter."""

    def force_n(run: Recording) -> FloatArray:
        late = predict(model, run, causal=True) / arm_m
        angle = run[f"{model.balance}_angle_rad"]
        return angle_led(late, angle, run.sample_rate_hz, model.low_pass)

    return force_n


def of_current(dof: str, method: CurrentForce) -> ToForce:
    """Return the force by the paper's method."""
    return lambda run: method.force_n(run[f"{dof}_current_a"], run.sample_rate_hz)


def report_runs(dof: str, axes: Axes, seed: int) -> dict[str, list[Recording]]:
    """Return the runs that are reported, by kind of input, at 2 kHz."""
    found: dict[str, list[Recording]] = {kind: [] for kind in INPUTS}
    for k, kind in enumerate(INPUTS):
        for j, force_n in enumerate(LEVELS_N):
            target = target_of(kind, axes[0], force_n)
            found[kind].append(record(f"{kind}-{force_n:g}N", dof, axes, target, seed + 10 * k + j))
    return found


def slope(dof: str, axes: Axes, method: CurrentForce, seed: int) -> float:
    """Return the slope of estimate over force at the ends of long steady grasps (Figure 11 b)."""
    points = []
    for k, force_n in enumerate(LEVELS_N):
        run = record("long", dof, axes, target_of("long", axes[0], force_n), seed + k)
        kept = _between(run, *end_of_hold(LONG_S))
        estimate = of_current(dof, method)(run)
        force = run[f"{dof}_torque_n_m"] / axes[0].arm_m
        points.append((float(force[kept].mean()), float(estimate[kept].mean())))
    force, estimate = np.array(points).T
    return float(np.polyfit(force, estimate, 1)[0])


def outcome(
    dof: str, tests: Mapping[str, Sequence[Recording]], estimate: ToForce, arm_m: float
) -> Outcome:
    """Return the result of a method on the reported runs."""
    errors, delays = [], []
    for kind, runs in tests.items():
        of_kind = []
        for run in runs:
            force = run[f"{dof}_torque_n_m"] / arm_m
            found = estimate(run)
            if kind == "periodic":
                error, delay = _at_peaks(found, force, run.sample_rate_hz)
                delays.append(delay)
            else:
                kept = _between(run, *end_of_hold(LONG_S if kind == "long" else SHORT_S))
                error = float(found[kept].mean() - force[kept].mean())
            of_kind.append(error)
        errors.append(float(np.mean(of_kind)))
    return Outcome((errors[0], errors[1], errors[2]), float(np.mean(delays)))


def target_of(kind: str, axis: AxisParameters, force_n: float) -> FloatArray:
    """Return the path of the master of one of `INPUTS` up to a force, rad, shape (n,)."""
    if kind == "periodic":
        return periodic(axis, force_n)
    return hold(axis, force_n, LONG_S if kind == "long" else SHORT_S)


def _at_peaks(found: FloatArray, force: FloatArray, rate_hz: float) -> tuple[float, float]:
    """Return the error at the peaks of the last four cycles, N, and the delay, ms."""
    cycle = round(rate_hz / 2)
    smooth = ndimage.uniform_filter1d(force, max(1, round(0.01 * rate_hz)))
    parts = [slice(len(force) - (k + 1) * cycle, len(force) - k * cycle) for k in range(4)]
    errors = [float(found[part].max() - smooth[part].max()) for part in parts]
    last = slice(len(force) - 4 * cycle, len(force))
    estimate, truth = found[last] - found[last].mean(), smooth[last] - smooth[last].mean()
    step = max(1, round(0.001 * rate_hz))
    shifts = np.arange(-80, 81) * step
    match = [float(np.dot(np.roll(estimate, -shift), truth)) for shift in shifts]
    return float(np.mean(errors)), float(shifts[int(np.argmax(match))] / rate_hz * 1e3)


def _between(run: Recording, start_s: float, stop_s: float) -> FloatArray:
    return np.asarray((run.time_s >= start_s) & (run.time_s < stop_s))


def _averaged(run: Recording) -> Recording:
    n = len(run) // EVERY * EVERY
    return replace(
        run,
        time_s=run.time_s[:n].reshape(-1, EVERY).mean(axis=1),
        columns={k: v[:n].reshape(-1, EVERY).mean(axis=1) for k, v in run.columns.items()},
        flags=run.flags[:n:EVERY],
    )
