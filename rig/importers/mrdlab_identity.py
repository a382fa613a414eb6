"""Properties of a run from names and header lines of MRDLab logs: instrument, wrist, jaw stop.

Header text about the tool can be left over from an earlier session, so the folder's name wins: a
lot is believed only where the header's tool number agrees with the folder's.
"""

import re
from dataclasses import dataclass

import numpy as np

from estimation.recording import Instrument

FOLDER = re.compile(
    r"Tool_(?P<tool>\d+)_(?P<model>[A-Za-z]+)_(?P<side>[LR])"
    r"(?:_(?P<joint>Roll|Pitch)_(?P<step>\d+)|_(?P<mounting>\d+))?"
)
"""The number after the side is not explained; the same tool under another number differs in its
torques by as much as another tool, so it is taken for a mounting."""
HEADER_TOOL = re.compile(r"tool number (?P<tool>\d+) Lot (?P<lot>\w+(?: \w+)?) with", re.IGNORECASE)
WRIST_DEG: dict[str, tuple[float, ...]] = {
    "Roll": (-90.0, -45.0, 0.0, 45.0, 90.0),
    "Pitch": (60.0, 30.0, 0.0, -30.0, -60.0),
}
"""Angle of each numbered folder. Roll and pitch were varied one at a time, the other at zero
(O'Neill et al. 2018, section on experiment 3)."""
SIDES = {"L": "left", "R": "right"}


@dataclass(frozen=True, slots=True)
class Identity:
    """What is known of a run before its samples are read.

    Attributes:
        instrument: Identity of the instrument.
        conditions: `wrist_roll_rad`, `wrist_pitch_rad` and `jaw_stop_index` where available.
        remarks: How the identity was found, one sentence each.
    """

    instrument: Instrument
    conditions: dict[str, float | str]
    remarks: tuple[str, ...]


def identify(folder: str, stem: str, header: str) -> Identity:
    """Combine the folder's name, the file's stem and the header text.

    Args:
        folder: Name of the folder the file lies in, such as `Tool_4_Maryland_L_Roll_1`.
        stem: File name without its suffix; of three digits, the first is the jaw stop.
        header: The `%` lines.
    """
    conditions: dict[str, float | str] = {}
    remarks: list[str] = []
    in_header = HEADER_TOOL.search(header)
    named = FOLDER.search(folder)
    if re.fullmatch(r"\d{3}", stem):
        conditions["jaw_stop_index"] = float(stem[0])
    if named is None:
        remarks.append(
            f"The folder name {folder!r} does not follow Tool_<n>_<model>_<L|R>: the wrist is "
            "unknown."
        )
        tool, lot = (in_header["tool"], in_header["lot"]) if in_header else (None, None)
        return Identity(
            Instrument(serial=f"tool {tool}" if tool else None, lot=lot),
            conditions,
            tuple(remarks),
        )
    if named["joint"]:
        remarks += _wrist(named["joint"], int(named["step"]), conditions)
    lot = None
    if in_header and in_header["tool"] == named["tool"]:
        lot = in_header["lot"]
    elif in_header:
        remarks.append(
            f"The header names tool {in_header['tool']}, lot {in_header['lot']}; the folder names "
            f"tool {named['tool']} and wins, so the lot is unknown."
        )
    instrument = Instrument(
        model=named["model"],
        serial=f"tool {named['tool']}",
        lot=lot,
        side=SIDES[named["side"]],
        mounting=named["mounting"],
    )
    return Identity(instrument, conditions, tuple(remarks))


def _wrist(joint: str, step: int, conditions: dict[str, float | str]) -> list[str]:
    angles_deg = WRIST_DEG[joint]
    if not 1 <= step <= len(angles_deg):
        return [f"{joint}_{step} is not one of {joint}_1..{len(angles_deg)}: its angle is unknown."]
    angle_rad = float(np.deg2rad(angles_deg[step - 1]))
    roll = joint == "Roll"
    conditions["wrist_roll_rad"] = angle_rad if roll else 0.0
    conditions["wrist_pitch_rad"] = 0.0 if roll else angle_rad
    return []
