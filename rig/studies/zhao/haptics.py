"""Haptic experiments of Zhao and Nelson 2016, section 4: stiffness from angle and estimated force.

Three materials are distinguished, and a stiff inclusion is found among seven places, three grasps
each. Stiffness is the slope of estimated force over joint angle while the grasp closes. Friction
adds to that slope, to all places alike, so the answer does not need it declared; its size does.
"""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy import stats

from estimation.filters import CausalFilter, LowPass
from estimation.model import Model, predict
from estimation.recording import FloatArray, Recording
from rig.grasper.current_force import FILTER, CurrentForce
from rig.grasper.plant import PROTOTYPES, RATE_HZ, hold
from rig.studies.seeds import Keeper, kept_outcomes
from rig.studies.zhao.methods import Axes, axes_of, declared, fitted, on_object, record

MATERIALS_N_M_RAD = {"wood": 2.0, "foam": 0.3, "sponge": 0.06}
"""Stiffness at the joint. Assumed; the paper gives none."""
PLACES, GRASPS = 7, 3
TISSUE_N_M_RAD, INCLUSION_RATIO = 0.15, 2.0
PEAK_N = 1.5
RISE_S = 4.0
"""A palpating grasp is slow: the filters' lag must not pass for a slope."""
SCHEMA = "rig.study.haptics/1"
DOF = "grasp"
LEVEL = 0.95
"""Confidence from which an answer counts as sure."""

Estimate = Callable[[Recording], tuple[FloatArray, FloatArray]]
"""Gives the force and the angle of a run, N and rad, filtered alike."""


@dataclass(frozen=True)
class Stiffness:
    """One place or material."""

    name: str
    true_n_rad: float  # what it is, force at the tip over joint angle
    grasps_n_rad: tuple[float, ...]

    @property
    def mean_n_rad(self) -> float:
        """Mean of the grasps."""
        return float(np.mean(self.grasps_n_rad))


@dataclass(frozen=True)
class Answer:
    """The result of one method."""

    method: str
    materials: tuple[Stiffness, ...]
    # confidence that neighbours in the found order differ, the least of them
    order_confidence: float
    order_is_right: bool
    places: tuple[Stiffness, ...]
    found: int  # place with the inclusion, from 0
    true: int
    place_confidence: float  # confidence that this place is stiffer than the stiffest other


def haptics_of(
    prototype: str, seeds: int, spread: float, model: Model, keeper: Keeper
) -> list[tuple[Answer, ...]]:
    """Return the answers on graspers of one make of `PROTOTYPES`, one tuple a seed, in order."""
    one = partial(run_haptics, prototype, spread, model)
    name = f"{SCHEMA} {prototype} {spread:g}"
    return kept_outcomes(tuple[Answer, ...], one, seeds, name, keeper)


def run_haptics(prototype: str, spread: float, model: Model, seed: int) -> tuple[Answer, ...]:
    """Return the answers of the paper's method, of ours, and of ours with friction not declared."""
    axes = axes_of(PROTOTYPES[prototype], DOF, seed, spread)
    method, arm_m = CurrentForce(axes[0].arm_m), axes[0].arm_m

    def of_model(model: Model) -> Estimate:
        made = fitted(DOF, axes, seed, model)
        return lambda run: (predict(made, run, causal=True) / arm_m, _low(run, made.low_pass))

    def of_current(run: Recording) -> tuple[FloatArray, FloatArray]:
        return method.force_n(run[f"{DOF}_current_a"], RATE_HZ), _low(run, FILTER)

    methods = {
        "paper's method": of_current,
        "ours": of_model(model),
        "ours, friction not declared": of_model(declared(DOF)),
    }
    return tuple(_answer(name, way, axes, seed) for name, way in methods.items())


def _answer(method: str, estimate: Estimate, axes: Axes, seed: int) -> Answer:
    random = np.random.default_rng(seed + 4711)
    materials = tuple(
        _grasped(name, k, axes, estimate, random) for name, k in MATERIALS_N_M_RAD.items()
    )
    true = int(random.integers(PLACES))
    tissue = TISSUE_N_M_RAD * np.exp(0.08 * random.standard_normal(PLACES))
    tissue[true] *= INCLUSION_RATIO
    places = tuple(
        _grasped(str(k + 1), float(stiffness), axes, estimate, random)
        for k, stiffness in enumerate(tissue)
    )
    ranked = sorted(materials, key=lambda s: s.mean_n_rad, reverse=True)
    pairs = itertools.pairwise(ranked)
    by_stiffness = sorted(range(PLACES), key=lambda k: places[k].mean_n_rad, reverse=True)
    first, second = by_stiffness[:2]
    return Answer(
        method,
        materials,
        min(_confidence(a.grasps_n_rad, b.grasps_n_rad) for a, b in pairs),
        [s.name for s in ranked] == list(MATERIALS_N_M_RAD),
        places,
        first,
        true,
        _confidence(places[first].grasps_n_rad, places[second].grasps_n_rad),
    )


def _grasped(
    name: str, stiffness: float, axes: Axes, estimate: Estimate, random: np.random.Generator
) -> Stiffness:
    slopes = []
    for _ in range(GRASPS):
        held = on_object(axes, stiffness, float(random.uniform(0.08, 0.12)))
        asked = hold(held[0], PEAK_N, 0.5, RISE_S)
        run = record(name, DOF, held, asked, int(random.integers(1_000_000)))
        force, angle = estimate(run)
        slopes.append(_slope(force, angle))
    return Stiffness(name, stiffness / axes[0].arm_m, tuple(slopes))


def _slope(force_n: FloatArray, angle_rad: FloatArray) -> float:
    """Return the slope over the upper part of the loading, where the grasp is in contact."""
    top = int(np.argmax(force_n))
    rested = float(np.median(force_n[: top // 3]))
    low = rested + 0.4 * (force_n[top] - rested)
    high = rested + 0.9 * (force_n[top] - rested)
    below = np.flatnonzero(force_n[:top] < low)
    start = int(below[-1]) + 1 if below.size else 0
    kept = slice(start, start + int(np.argmax(force_n[start:] >= high)))
    return float(np.polyfit(angle_rad[kept], force_n[kept], 1)[0])


def _confidence(high: Sequence[float], low: Sequence[float]) -> float:
    """Return one less the one-sided p-value of Welch's test that the first mean is greater."""
    return float(1.0 - stats.ttest_ind(high, low, equal_var=False, alternative="greater").pvalue)


def _low(run: Recording, low_pass: LowPass) -> FloatArray:
    angle = run[f"{DOF}_angle_rad"]
    return CausalFilter(run.sample_rate_hz, low_pass).step(angle[:, None])[:, 0]
