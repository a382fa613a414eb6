"""The menu of experiments a diagnosis may propose, each a protocol within what the rig has done."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from estimation.recording import Recording
from rig.configuration.machine_settings import ReferenceLimits
from rig.protocols.protocol import Protocol

LOADS_A = (0.15, 0.5, 0.9)
MARGIN = 0.8
"""Share of a limit that a proposed experiment may use."""


@dataclass(frozen=True)
class Room:
    """What an experiment may use.

    Attributes:
        open_rad: Spindle angle where the travel begins.
        travel_rad: Travel from there.
        loads_a: Loads.
    """

    open_rad: float
    travel_rad: float
    loads_a: tuple[float, ...]


def room_of(recordings: Sequence[Recording], limits: ReferenceLimits) -> Room:
    """Return the travel the recordings have shown, and loads within the rig's limits."""
    angles = np.concatenate([r["spindle_angle_rad"] for r in recordings])
    low, high = (float(v) for v in np.percentile(angles, [1, 99]))
    reach = MARGIN * limits.spindle_angle_rad
    low, high = max(low, -reach), min(high, reach)
    loads = tuple(load for load in LOADS_A if load <= MARGIN * limits.load_command_a)
    return Room(low, high - low, loads)


def within(recordings: Sequence[Recording], limits: ReferenceLimits) -> bool:
    """Whether simulated runs stay away from every limit."""
    return all(
        float(np.abs(run[name]).max()) <= MARGIN * limit
        for run in recordings
        for name, limit in limits.model_dump().items()
        if name in run
    )


def menu(room: Room) -> list[Protocol]:
    """Return the experiments: six short runs each, so that some of them can confirm."""
    starts = [round(room.open_rad + share * room.travel_rad, 4) for share in (0.05, 0.3)]
    travel = round(0.6 * room.travel_rad, 4)
    loads = list(room.loads_a)
    every = {"loads_a": loads, "jaw_starts_rad": starts}
    half = {"amplitude_rad": round(0.5 * travel, 4)}
    ten = {"duration_s": 10.0}
    low, middle, high = loads[0], loads[len(loads) // 2], loads[-1]
    levels = [round(share * travel, 4) for share in (0, 0.5, 1, 0.5, 0)]
    tiny, small = (round(share * room.travel_rad, 4) for share in (0.04, 0.06))
    sine, speeds = {"kind": "sine", **ten}, [0.12, 0.3, 0.8, 1.5]
    staircase = {"kind": "speed_staircase", "speeds_rad_s": speeds, "pause_s": 0.1}
    climb = {"kind": "load_staircase", "loads_a": [low, high, middle, low], "hold_s": 3.0}
    faster = {"kind": "chirp", "low_hz": 0.2, "high_hz": 4.0}
    rests = {"kind": "dwell", "dwells_s": [0.2, 4.0, 1.0, 0.2, 2.0]}
    entries: list[tuple[str, str, dict[str, object]]] = [
        (
            "grasps",
            "the plain grasps again, at three loads",
            {**sine, "frequencies_hz": [0.3], **half, **every},
        ),
        (
            "speeds",
            "constant speeds from slow to fast, both ways, at three loads",
            {**staircase, "travel_rad": travel, **every},
        ),
        (
            "reversals",
            "tiny motions to and fro, at three loads",
            {**sine, "frequencies_hz": [0.8], "amplitude_rad": tiny, **every},
        ),
        (
            "holds",
            "steps that are held, at three loads",
            {"kind": "step_hold", "levels_rad": levels, "hold_s": 2.5, **every},
        ),
        (
            "loads",
            "grasps while the load climbs and falls",
            {**climb, "frequencies_hz": [0.15, 0.3, 0.5], "jaw_starts_rad": starts, **half},
        ),
        (
            "free",
            "slow and fast sweeps without load",
            {**sine, "frequencies_hz": [0.1, 0.25, 0.5], **every, "loads_a": [0.0], **half},
        ),
        (
            "chirp",
            "small grasps that become faster and faster",
            {**faster, "amplitude_rad": small, **every},
        ),
        (
            "dwells",
            "moves after rests of different length",
            {**rests, "travel_rad": travel, **every},
        ),
    ]
    return [
        Protocol.model_validate({"name": name, "description": what, "runs": [table]})
        for name, what, table in entries
    ]
