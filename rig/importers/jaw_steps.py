"""Find steps of the jaw's zero between the runs of a campaign, and count them out.

A cable that slips on its pulley, or a re-index, moves the zero of the jaw's encoder; every later
run is off by the step. A single run does not show it. Runs that share conditions do: each level of
a condition moves the mean angle of the jaw by as much in every run,

    mean angle of run k = sum over conditions of the level's share + zero of its segment.

Segments of consecutive runs are found by binary segmentation with the Bayesian information
criterion (J. Bai, P. Perron, "Estimating and testing linear models with multiple structural
changes", Econometrica 66 (1998); Y.-C. Yao, "Estimating the number of change-points via Schwarz'
criterion", Statistics & Probability Letters 6 (1988)).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations

import numpy as np
from scipy.linalg import orth

from estimation.campaign import Campaign, Run
from estimation.recording import FloatArray, Recording

JAW = "jaw_angle_rad"
STEP_LIMIT_RAD = float(np.deg2rad(0.3))
"""On the reference rig, equal runs repeat within 0.22 deg and steps are 0.35 to 0.63 deg."""
LEAST_RAD2 = 1e-18
ALIKE = {
    "load_command_a": 0.01,
    "jaw_stop_index": 1.0,
    "trajectory_centre_rad": 0.1,
    "trajectory_amplitude_rad": 0.1,
    "wrist_roll_rad": 0.01,
    "wrist_pitch_rad": 0.01,
}
"""Conditions that move the jaw's mean angle, and how closely equal levels must agree."""


@dataclass(frozen=True, slots=True)
class JawStep:
    """A step of the jaw's zero."""

    run: str
    step_rad: float  # change of the zero, rad, closing positive


def with_one_zero(campaign: Campaign, target: str) -> tuple[Campaign, tuple[JawStep, ...]]:
    """Return a campaign with the jaw's zero where the last run has it, and the steps taken off.

    Zeros are found by comparing runs that share conditions: the load stretches the cable and so
    moves the jaw by degrees; the share of each load, wrist, trajectory and instrument is fitted
    with the zeros. Flagged samples are left out. One run is held at a time. A campaign with as many
    levels as runs shows no step. The runs are in the order they were taken. A campaign to estimate
    another target than `jaw_angle_rad` on is returned as it is.

    Raises:
        MissingChannelError: A run has no `jaw_angle_rad`.
    """
    if target != JAW:
        return campaign, ()
    names, means, levels = [], [], []
    for recording in campaign.evidence:
        if recording.valid.any():
            names.append(recording.name)
            means.append(float(recording[JAW][recording.valid].mean()))
            levels.append(_levels(recording))
    if not names:
        return campaign, ()
    zero_rad = _segmented(np.array(means), _shares(levels))
    changes = np.diff(zero_rad)
    steps = tuple(JawStep(names[k + 1], float(changes[k])) for k in np.flatnonzero(changes))
    from_last_rad = dict(zip(names, (zero_rad - zero_rad[-1]).tolist(), strict=True))
    runs = [
        replace(run, load=partial(_shifted, run, from_last_rad[run.name]))
        if from_last_rad.get(run.name)
        else run
        for run in campaign.runs
    ]
    return Campaign(tuple(runs)), steps


def sentence(steps: Sequence[JawStep]) -> list[str]:
    """Return one sentence for a person on the steps taken off; nothing where there is none."""
    if not steps:
        return []
    each = ", ".join(f"{np.rad2deg(s.step_rad):+.2f} deg before run {s.run}" for s in steps)
    return [
        f"The zero of the jaw's encoder steps between runs: {each}. All runs, also those reported"
        " on, are counted from the zero of the last run."
    ]


def _segmented(means: FloatArray, shares: FloatArray) -> FloatArray:
    """Return the zero of each run's segment from the means of the runs, shape (runs,) both."""
    basis = orth(shares)
    count, free = basis.shape
    after = np.tri(count, count - 1, -1)  # column k: the runs after a cut before run k + 1
    own, rest = (part - basis @ (basis.T @ part) for part in (after, means))
    gram, cross = own.T @ own, own.T @ rest
    cuts: list[int] = []
    steps, cost = np.zeros(0), float(rest @ rest)
    while True:
        best: tuple[float, list[int], FloatArray, float] | None = None
        places = [place for place in range(count - 1) if place not in cuts]
        for more in [*((place,) for place in places), *combinations(places, 2)]:
            trial = sorted([*cuts, *more])
            left = count - free - 2 * len(trial)
            if left < 2:
                continue
            found = np.asarray(np.linalg.lstsq(gram[np.ix_(trial, trial)], cross[trial])[0])
            squares = max(float(rest @ rest - found @ cross[trial]), LEAST_RAD2)
            # what the levels have taken is no evidence; a cut costs its place and its height
            gain = left * np.log(cost / squares) - 2 * len(more) * np.log(count)
            large = np.abs(found).min() > STEP_LIMIT_RAD
            if gain > 0 and large and (best is None or gain > best[0]):
                best = float(gain), trial, found, squares
        if best is None:
            return np.asarray(after[:, cuts] @ steps)
        _, cuts, steps, cost = best


def _shifted(run: Run, zero_rad: float) -> Recording:
    recording = run.load()
    return recording.with_columns(**{JAW: recording[JAW] - zero_rad})


def _levels(recording: Recording) -> tuple[object, ...]:
    parts: list[object] = [recording.instrument]
    for name, width in ALIKE.items():
        value = recording.conditions.get(name)
        parts.append(round(value / width) if isinstance(value, float) else value)
    return tuple(parts)


def _shares(levels: Sequence[tuple[object, ...]]) -> FloatArray:
    """Return a column for each level of each condition, shape (runs, columns)."""
    columns = [np.ones(len(levels))]
    for one in zip(*levels, strict=True):
        columns += [
            np.array([float(other == level) for other in one]) for level in dict.fromkeys(one)
        ]
    return np.column_stack(columns)
