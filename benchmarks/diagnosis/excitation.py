"""What a case's runs play: the protocol that the rig ships, or one that hides what it could."""

import numpy as np

from rig.protocols import trajectory
from rig.protocols.protocol import Protocol, RunPlan, load_protocol

RUNS = 14
EXCITATIONS = ("usual", "one spring", "constant speed", "rests", "wrist")
"""`rests` adds rests of several lengths; in `wrist` the wrist swings while the jaw works."""

DWELLS = {
    "kind": "dwell",
    "travel_rad": 0.5,
    "move_s": 0.6,
    "dwells_s": [0.1, 0.4, 3.0, 0.2, 1.5, 0.6, 0.1, 2.0, 0.3],
    "jaw_starts_rad": [-0.95, -0.7],
    "loads_a": [0.15, 0.45, 0.8],
}


def plans_of(excitation: str) -> list[RunPlan]:
    """Return the runs of an excitation, `RUNS` of them."""
    usual = load_protocol("diagnosis")
    if excitation == "one spring":
        return [_sprung(plan) for plan in usual.plans()]
    if excitation == "constant speed":
        return [_steady(index) for index in range(RUNS)]
    if excitation == "rests":
        moving = usual.plans()[: RUNS - 6]
        resting = Protocol.model_validate({"name": "diagnosis", "runs": [DWELLS]}).plans()
        numbered = [*moving, *resting]
        return [
            RunPlan(f"{k:03d}-{p.name[4:]}", p.target_angle_rad, p.load_command_a, p.conditions)
            for k, p in enumerate(numbered)
        ]
    return usual.plans()


def wrist_motion(excitation: str, index: int) -> dict[str, float]:
    """Return the motion of the wrist in one run, as parameters of the plant; none where it is held.

    Each run has another pose and period, without a common period of the jaw's motion.
    """
    if excitation != "wrist":
        return {}
    return {
        "wrist_middle_rad": (-0.2, 0.1, 0.3, 0.0, -0.35)[index % 5],
        "wrist_swing_rad": (0.4, 0.55, 0.3)[index % 3],
        "wrist_period_s": 2.3 + 0.37 * index,
    }


def _sprung(plan: RunPlan) -> RunPlan:
    """Return the run against one spring: the load is a function of the angle in every run."""
    load = 0.1 + 0.7 * np.clip(plan.target_angle_rad + 1.05, 0.0, None)
    name = "-".join(plan.name.split("-")[:2])
    conditions = {k: v for k, v in plan.conditions.items() if k != "load_command_a"}
    return RunPlan(name, plan.target_angle_rad, load, conditions)


def _steady(index: int) -> RunPlan:
    """Return a run at one speed either way, against one of several loads."""
    load = (0.1, 0.3, 0.5, 0.7, 0.9)[index % 5]
    start = -1.0 + 0.05 * (index % 3)
    angle = trajectory.speed_staircase(start, 0.7, [0.5] * 5, 1e-3)
    conditions: dict[str, float | str] = {"load_command_a": load, "jaw_start_rad": start}
    return RunPlan(f"{index:03d}-steady", angle, np.full(angle.size, load), conditions)
