"""Feetech STS3215 servos with a pendulum, recorded by K-Scale Labs: one run a condition, 100 Hz.

The servo reports how much of its supply it applies (percent, without sign), its position and its
speed; it applies it towards the goal, which is the sign here. Declared is what its owners begin
with: the pendulum's weight and inertia, viscous and Coulomb friction. They reached .0323 to .0309
rad of mean position error in simulation with six friction models, after cutting out the stretches
with backlash, oscillation and dead zone by hand; nobody knows the whole answer.
"""

import json
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.diagnosis.case import MACHINE, Case, Judgement, Report
from benchmarks.diagnosis.machines.handover import Run, errors, options, write

TARGET = "drive_ratio"
RATE_HZ = 100.0
SHOWN = ((1.1682, 0.1), (0.969, 0.15))
"""Mass, kg, and length of the pendulum, m: what is found on one should be found on the other."""

GRAVITY_M_S2 = 9.80665


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


def read(content: dict[str, object]) -> Run:
    """Return one run on an even clock."""
    entries = content["entries"]
    assert isinstance(entries, list)
    read = {
        name: np.array([float(entry[name]) for entry in entries])
        for name in ("timestamp", "position", "torque", "goal_position", "input_volts", "temp")
    }
    angle = np.unwrap(read["position"])
    towards = np.sign(read["goal_position"] - angle)
    uneven = {
        "motor_angle_rad": angle,
        "target_angle_rad": read["goal_position"],
        "weight_n_m": float(str(content["mass"]))
        * GRAVITY_M_S2
        * float(str(content["length"]))
        * np.sin(angle),
        "supply_v": read["input_volts"],
        "motor_temperature_k": read["temp"] + 273.15,
        TARGET: towards * read["torque"] / 100.0,
    }
    time_s = np.arange(0.0, read["timestamp"][-1], 1.0 / RATE_HZ)
    columns = {k: np.interp(time_s, read["timestamp"], v) for k, v in uneven.items()}
    return Run(
        f"{content['trajectory']}_kp{content['kp']:02}",
        time_s,
        columns,
        {
            "trajectory": str(content["trajectory"]),
            "position_gain_ratio": float(str(content["kp"])),
        },
    )


def judge(runs: Sequence[Run], report: Report) -> Judgement:
    """Return the errors; nobody knows all that the model lacks."""
    return Judgement(None, note=errors(runs, TARGET, report).percent())
