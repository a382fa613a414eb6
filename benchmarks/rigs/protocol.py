"""Random protocols: what the spindle is asked to follow, and what the load does, run by run."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from benchmarks.rigs.plant import Plant, over
from estimation.recording import FloatArray
from rig.protocols import trajectory
from rig.simulation.forms import Random
from rig.simulation.plant import TICK_S

LEAD_S = 0.8
"""Time before a run's first sample in which the load comes and nothing moves."""

MOTIONS = ("sine", "sweep", "multisine", "trapezoid", "smooth", "dwell")
LOADS = ("levels", "signed", "springs", "varying")
SHAPED = ("load_position", "load_time")
"""Loads of protocols that confound: one function of the angle, or of time, in every run."""

LONGEST_S = 220.0
"""Most time of all runs together."""


class LoadUnit(NamedTuple):
    """What of the load answers the jaw: a spring about an angle, and damping; SI units."""

    spring: float
    rest: float
    viscous: float


@dataclass(frozen=True, eq=False)
class Plan:
    """One run as it is asked for.

    Attributes:
        setpoints: Angle, speed and acceleration of the spindle at 1 kHz from the lead on, (n, 3).
        level_n_m: Load torque asked for, without the unit's spring, shape (n,).
        load: The load unit in this run.
        conditions: As a recording states them.
        start_s: Campaign time of the run's first sample.
        jumps: 0 or 1, switched at random times, shape (n,).
    """

    name: str
    setpoints: FloatArray
    level_n_m: FloatArray
    load: LoadUnit
    conditions: Mapping[str, float | str]
    start_s: float
    jumps: FloatArray


@dataclass(frozen=True)
class Protocol:
    """How a campaign was made up.

    Attributes:
        motions: Kinds of motion, of `MOTIONS`.
        load: One of `LOADS` or `SHAPED`.
        duration_s: Of each.
    """

    motions: tuple[str, ...]
    load: str
    runs: int
    duration_s: float
    levels: int


def draw_protocol(
    random: Random, plant: Plant, load: str | None = None, rests: bool | None = None
) -> tuple[Protocol, tuple[Plan, ...]]:
    """Draw a protocol for a rig, and its runs; a load or rests that are given are not drawn."""
    runs = int(random.integers(8, 21))
    duration = float(np.round(min(random.uniform(8.0, 20.0), max(LONGEST_S / runs, 8.0)), 1))
    rests = bool(random.random() < 0.4) if rests is None else rests
    lively = [str(kind) for kind in random.permutation(MOTIONS[:5])]
    kinds = tuple(lively[: int(random.integers(2, 5))]) + (("dwell",) if rests else ())
    kind = str(random.choice(LOADS)) if load is None else load
    count = int(random.integers(3, 6))
    protocol = Protocol(kinds, kind, runs, duration, count)
    centre = float(random.uniform(-0.8, 0.8))
    reach = over(random, 0.25, 0.6)
    levels = _levels(random, plant, kind, count)
    shaped = _shape(random, duration)
    gap = float(random.uniform(3.0, 20.0))
    plans = []
    for k in range(runs):
        motion = kinds[k % len(kinds)]
        angle, extra = _motion(random, motion, duration, centre, reach, plant.ratio)
        level = float(levels[(k // len(kinds) + k) % count])
        course, unit, known = _loading(random, kind, level, len(angle), centre, plant, shaped)
        lead = round(LEAD_S / TICK_S)
        setpoints = _setpoints(angle, lead)
        ramp = trajectory.minimum_jerk(0.0, float(course[0]), 0.6 * LEAD_S)
        before = np.concatenate([ramp, np.full(lead - len(ramp), course[0])])
        plans.append(
            Plan(
                f"{k:03d}-{motion}",
                setpoints,
                np.concatenate([before, course]),
                unit,
                {"motion": motion, **extra, **known},
                k * (duration + gap),
                _switched(random, len(setpoints)),
            )
        )
    return protocol, tuple(plans)


def _levels(random: Random, plant: Plant, kind: str, count: int) -> FloatArray:
    spread = np.linspace(random.uniform(0.1, 0.3), 1.0, count) * plant.load_scale
    if kind == "signed":
        spread *= np.where(np.arange(count) % 2 == 0, 1.0, -1.0)
    if kind in SHAPED:
        spread[:] = plant.load_scale
    return np.asarray(spread)


def _shape(random: Random, duration_s: float) -> FloatArray:
    """Return how the load goes with time in every run where it confounds, 0.2 to 1."""
    t = trajectory.times(duration_s) / duration_s
    time = random.uniform(0.2, 0.8)
    kinds = (1.0 - np.exp(-t / time), t, t / (t + time))
    form = kinds[int(random.integers(len(kinds)))]
    return np.asarray(0.2 + 0.8 * form / form[-1])


def _loading(
    random: Random, kind: str, level: float, n: int, centre: float, plant: Plant, shaped: FloatArray
) -> tuple[FloatArray, LoadUnit, dict[str, float | str]]:
    """Return the torque asked for, what answers the jaw, and the run's conditions."""
    damping = 0.02 * plant.load_scale
    rest = plant.pull * centre + plant.jaw_zero
    flat = np.full(n, level)
    stated: dict[str, float | str] = {"load_command_a": round(level / plant.load_constant, 4)}
    if kind == "load_time":
        return level * shaped, LoadUnit(0.0, rest, damping), stated
    if kind == "load_position":
        return 0.55 * flat, LoadUnit(0.9 * plant.load_scale, rest, damping), stated
    if kind == "springs":
        spring = float(random.choice([0.0, 0.4, 1.0])) * plant.load_scale
        stated["load_stiffness_n_m_rad"] = round(spring, 4)
        return 0.6 * flat, LoadUnit(spring, rest, damping), stated
    if kind == "varying":
        t = np.arange(n) * TICK_S
        wave = random.uniform(0.2, 0.5) * np.sin(
            2.0 * np.pi * random.uniform(0.05, 0.6) * t + random.uniform(0.0, 6.3)
        )
        steps = np.repeat(random.uniform(-0.3, 0.3, n // 2500 + 1), 2500)[:n]
        smooth = np.convolve(np.pad(steps, 200, mode="edge"), np.full(401, 1 / 401), "valid")
        return level * (0.8 + wave + smooth), LoadUnit(0.0, rest, damping), stated
    return flat, LoadUnit(0.0, rest, damping), stated


def _motion(
    random: Random, kind: str, duration_s: float, centre: float, reach: float, ratio: float
) -> tuple[FloatArray, dict[str, float | str]]:
    """Return the spindle's angle and what a run states of it."""
    t = trajectory.times(duration_s)
    amplitude = reach * float(random.uniform(0.7, 1.0))
    slowest = max(0.08, 2.5 / ratio / (2.0 * np.pi * amplitude))
    hz = over(random, slowest, max(0.9, 1.5 * slowest))
    start = centre - amplitude
    if kind == "sine":
        return trajectory.sine(duration_s, start, amplitude, hz), {"frequency_hz": round(hz, 3)}
    if kind == "sweep":
        return trajectory.chirp(duration_s, start, amplitude, slowest, max(1.2, 2 * slowest)), {}
    if kind == "multisine":
        rates = over(random, 0.06, 0.12) * np.array([1, 2, 3, 5, 7, 9]) * max(1.0, slowest / 0.1)
        sizes = random.uniform(0.3, 1.0, 6) / np.arange(1, 7)
        phases = random.uniform(0.0, 2.0 * np.pi, 6)
        wave = (sizes[:, None] * np.sin(2 * np.pi * np.outer(rates, t) + phases[:, None])).sum(0)
        return centre + amplitude * (wave - wave.mean()) / np.max(np.abs(wave - wave.mean())), {}
    if kind == "trapezoid":
        speeds = [over(random, max(0.2, 4.0 / ratio), 2.0) for _ in range(40)]
        pause = 0.06
        angle = trajectory.speed_staircase(start, 2.0 * amplitude, speeds, pause)
        return _eased(np.resize(angle, len(t)) if len(angle) < len(t) else angle[: len(t)], 25), {}
    if kind == "dwell":
        rests = random.choice([0.1, 0.3, 0.8, 1.5, 2.5], 60)
        angle = trajectory.dwells(start, 2.0 * amplitude, over(random, 0.4, 1.0), list(rests))
        return angle[: len(t)], {}
    rate = max(over(random, 0.3, 0.9), 1.5 * slowest)
    knots = random.standard_normal(int(duration_s * rate * 2) + 4)
    wave = _eased(np.repeat(knots, round(500 / rate))[: len(t) + 2000], round(400 / rate))
    wave = _eased(wave, round(400 / rate))[1000 : 1000 + len(t)]
    wave = np.pad(wave, (0, len(t) - len(wave)), mode="edge")
    return centre + amplitude * (wave - wave.mean()) / np.max(np.abs(wave - wave.mean())), {}


def _eased(angle: FloatArray, half: int) -> FloatArray:
    """Return an angle whose corners are rounded over so many samples to either side."""
    window = np.hanning(2 * half + 3)[1:-1]
    return np.convolve(np.pad(angle, half, mode="edge"), window / window.sum(), "valid")


def _setpoints(angle: FloatArray, lead: int) -> FloatArray:
    whole = np.concatenate([np.full(lead, angle[0]), angle])
    whole = _eased(whole, 15)
    speed = np.gradient(whole, TICK_S)
    return np.column_stack([whole, speed, np.gradient(speed, TICK_S)])


def _switched(random: Random, n: int) -> FloatArray:
    """Return a state that switches between 0 and 1 every two seconds or so."""
    waits = random.exponential(2.0, int(n * TICK_S) + 20)
    states = (np.arange(len(waits)) + int(random.integers(2))) % 2
    spans = np.maximum((waits / TICK_S).astype(int), 200)
    return np.asarray(np.repeat(states.astype(float), spans)[:n])
