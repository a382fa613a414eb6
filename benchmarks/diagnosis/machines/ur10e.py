"""Joint 6 of a Universal Robots UR10e moved alone, 100 Hz (S. Mamedov, Front. Robot. AI 7, 2020).

A row has time, angles, speeds, measured currents of the six joints, and more (31 columns).
Declared is inertia, viscous and Coulomb friction, all in the joint's current: the residual is 1.1 %
of the squared current, and the first two harmonics of the angle are 6 % of that. The whole answer
is not known. The joint goes to and fro every 10 s; a run is half of that, from the middle of one
stroke to the middle of the next, so that each holds both directions.
"""

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.diagnosis.case import MACHINE, Case, Judgement, Report
from benchmarks.diagnosis.machines.handover import Run, cut, errors, options, write

JOINT = 6
RATIO = 101.0
"""Turns of the motor for one of the joint, harmonic drive."""

TARGETS = ("motor_current_a", "drive_current_a")
FIRST_S, APART_S = 5.2, 5.0
RATE_HZ = 100.0


def cases(folder: Path) -> Iterator[Case]:
    """Yield one case a name of the target."""
    for target in TARGETS:
        runs = read(folder, target)
        yield Case(
            f"ur10e, joint {JOINT}, {target}",
            MACHINE,
            partial(write, runs),
            partial(judge, runs, target),
            options=options(f"ur10e_{target}"),
        )


def read(folder: Path, target: str) -> list[Run]:
    """Return the runs."""
    (path,) = folder.glob(f"*-joint_{JOINT}.csv")
    rows = np.loadtxt(path, delimiter=",")
    clock = rows[:, 0] - rows[0, 0]
    time_s = np.arange(0.0, clock[-1], 1.0 / RATE_HZ)
    angle = np.interp(time_s, clock, rows[:, JOINT])
    columns = {
        "motor_angle_rad": RATIO * angle,
        "spindle_angle_rad": angle,
        target: np.interp(time_s, clock, rows[:, 12 + JOINT]),
    }
    strokes = np.arange(FIRST_S, clock[-1] - 15.0, APART_S)
    at = np.round(strokes * RATE_HZ).astype(int).tolist()
    return cut(Run(f"joint_{JOINT}", time_s, columns), at)


def judge(runs: Sequence[Run], target: str, report: Report) -> Judgement:
    """Return the errors together with those of the quick fit, as shares of the squared current."""
    stated = errors(runs, target, report)
    squared = f"squared {100 * stated.before**2:.2f} -> {100 * stated.after**2:.2f} %"
    return Judgement(None, note=f"{stated.percent()}; {squared}, quick fit 1.1 %")
