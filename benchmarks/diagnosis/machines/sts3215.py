"""Feetech STS3215 servos with a pendulum, recorded by K-Scale Labs: one run a condition, 100 Hz.

The drive is what the servo's proportional law applies: gain x (goal - position), as its owners
simulate it, in share of the supply; it saturates where the product is about 6 rad (fits of the
declared model get worse on either side). The servo's own reading of its drive has no sign. Readings
of -pi are drop-outs and left out; so is the time in which the drive was switched off.

Declared is what the owners begin with: the pendulum's weight and inertia, viscous and Coulomb
friction. They reached .0323 to .0309 rad of mean position error in simulation with six friction
models, after cutting out the stretches with backlash, oscillation and dead zone by hand; nobody
knows the whole answer.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.diagnosis.case import MACHINE, Case, Judgement, Report
from benchmarks.diagnosis.machines.handover import Run, errors, options, write

TARGET = "drive_ratio"
RATE_HZ = 100.0
SHOWN = ((1.1682, 0.1), (0.969, 0.15))
"""Mass, kg, and length of the pendulum, m: what is found on one should be found on the other."""

GRAVITY_M_S2 = 9.80665
SATURATION_RAD = 6.0
LOST_RAD = -3.1


def cases(folder: Path) -> Iterator[Case]:
    """Yield one case a pendulum: all its gains and trajectories."""
    contents = [json.loads(path.read_text()) for path in sorted(folder.glob("*.json"))]
    for mass_kg, length_m in SHOWN:
        held = [c for c in contents if (c["mass"], c["length"]) == (mass_kg, length_m)]
        runs = sorted((read(content) for content in held), key=lambda run: run.name)
        yield Case(
            f"sts3215, {mass_kg:g} kg at {length_m:g} m",
            MACHINE,
            partial(write, runs),
            partial(judge, runs),
            options=options("sts3215"),
        )


def read(content: Mapping[str, Any]) -> Run:
    """Return one run on an even clock."""
    entries = [e for e in content["entries"] if e["torque_enable"] and e["position"] > LOST_RAD]
    clock, angle, goal, volts, celsius = (
        np.array([float(entry[name]) for entry in entries])
        for name in ("timestamp", "position", "goal_position", "input_volts", "temp")
    )
    weight_n_m = content["mass"] * GRAVITY_M_S2 * content["length"] * np.sin(angle)
    uneven = {
        "motor_angle_rad": angle,
        "target_angle_rad": goal,
        "weight_n_m": weight_n_m,
        "supply_v": volts,
        "motor_temperature_k": celsius + 273.15,
        TARGET: np.clip(content["kp"] * (goal - angle) / SATURATION_RAD, -1.0, 1.0),
    }
    time_s = np.arange(0.0, clock[-1] - clock[0], 1.0 / RATE_HZ)
    columns = {name: np.interp(time_s + clock[0], clock, v) for name, v in uneven.items()}
    conditions = {"trajectory": content["trajectory"], "position_gain_ratio": float(content["kp"])}
    return Run(f"{content['trajectory']}_kp{content['kp']:02}", time_s, columns, conditions)


def judge(runs: Sequence[Run], report: Report) -> Judgement:
    """Return the errors; nobody knows all that the model lacks."""
    return Judgement(None, note=errors(runs, TARGET, report).percent())
