"""Which instrument an MRDLab log is of, by names, header and signs: lot, wrist, jaw stop, side.

Header text about the tool can be left over from an earlier session, so the folder's name wins: a
lot is believed only where the header's tool number agrees with the folder's.

The side of the jaw decides which way closes it. A right jaw turns the other way: every measured and
commanded column but the load's command has the opposite sign. The names state the side, in the
folder (`..._L_...`) and the header ("left spindle"), and so do the signs: at a positive command the
load motor pulls the jaw open, so torque at the jaw keeps one sign for the whole run, negative as
logged on a left jaw. On the public runs of left jaws its mean is 2.8 to 21 times its standard
deviation. A negative command shows no side: some right jaws were logged with one, and on a left jaw
it pushes the jaw shut.

Signs that contradict the names are refused, since a wrong side exchanges opening and closing. The
header's sentence is left over from earlier sessions in some folders, and then it names the left
spindle; so where folder and header differ, the one that states a right jaw counts.
"""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from estimation.recording import FloatArray, Instrument
from rig.errors import DataError
from rig.importers import mrdlab_text as raw

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
LEFT, RIGHT = "left", "right"
SIDES = {"L": LEFT, "R": RIGHT}
HEADER_SIDE = re.compile(r"\b(left|right) spindle", re.IGNORECASE)
THINNING = 10
SPAN = 2
"""Thinned samples either side of a central difference: 40 ms, several counts at the slowest run."""
CONTRADICTION = -0.5
"""Correlation with closing below which a sign is wrong; right ones are above 0.75, or near 0 in a
run that ran away."""
DRIVEN = {
    raw.PROXIMAL: ("proximal_torque_n_m", 1.0),
    raw.CURRENT: ("motor_current_a", 1.0),
    raw.COMMAND: ("motor_command_ratio", -1.0),
}
"""Columns that friction makes larger in closing than in opening, with their sign on a left jaw."""


@dataclass(frozen=True, slots=True)
class Identity:
    """What is known of a run from its names and signs, and how that was found, in sentences."""

    instrument: Instrument
    conditions: dict[str, float | str]
    remarks: tuple[str, ...]

    @property
    def sign(self) -> float:
        """Factor on every column of the log but time and load, beyond a left jaw's own signs."""
        return 1.0 if self.instrument.side == LEFT else -1.0


def identify(path: Path, header: str, columns: FloatArray) -> Identity:
    """Combine the folder's name, the file's stem, the header's `%` lines and the columns' signs.

    Of a stem of three digits the first is the jaw stop. The columns are raw values in the file's
    order, shape (10, n).

    Raises:
        DataError: Names and signs disagree, neither states a side, or a torque, the current or the
            command has a sign that the motion contradicts.
    """
    folder = path.parent.name
    named, in_header = FOLDER.search(folder), HEADER_TOOL.search(header)
    spindle = HEADER_SIDE.search(header)
    in_folder = SIDES[named["side"]] if named else None
    side, of_side = _side(path, in_folder, spindle[1].lower() if spindle else None, _shown(columns))
    _check_driven(path, columns, side)
    conditions: dict[str, float | str] = {}
    remarks: list[str] = []
    if re.fullmatch(r"\d{3}", path.stem):
        conditions["jaw_stop_index"] = float(path.stem[0])
    tool, lot = (in_header["tool"], in_header["lot"]) if in_header else (None, None)
    if named is None:
        remarks.append(
            f"The folder name {folder!r} does not follow Tool_<n>_<model>_<L|R>: the wrist is "
            "unknown."
        )
    else:
        if named["joint"]:
            remarks += _wrist(named["joint"], int(named["step"]), conditions)
        if in_header and tool != named["tool"]:
            remarks.append(
                f"The header names tool {tool}, lot {lot}; the folder names tool {named['tool']} "
                "and wins, so the lot is unknown."
            )
            lot = None
        tool = named["tool"]
    instrument = Instrument(
        model=named["model"] if named else None,
        serial=f"tool {tool}" if tool else None,
        lot=lot,
        side=side,
        mounting=named["mounting"] if named else None,
    )
    return Identity(instrument, conditions, (*remarks, *of_side))


def _wrist(joint: str, step: int, conditions: dict[str, float | str]) -> list[str]:
    angles_deg = WRIST_DEG[joint]
    if not 1 <= step <= len(angles_deg):
        return [f"{joint}_{step} is not one of {joint}_1..{len(angles_deg)}: its angle is unknown."]
    angle_rad = float(np.deg2rad(angles_deg[step - 1]))
    roll = joint == "Roll"
    conditions["wrist_roll_rad"] = angle_rad if roll else 0.0
    conditions["wrist_pitch_rad"] = 0.0 if roll else angle_rad
    return []


def _side(
    path: Path, in_folder: str | None, in_header: str | None, shown: str | None
) -> tuple[str, list[str]]:
    """Return the side of a log from its names and its signs, and how it was found."""
    stated = {side for side in (in_folder, in_header) if side is not None}
    named = f"folder {in_folder or 'states no side'}, header {in_header or 'states no side'}"
    if shown is None:
        if len(stated) == 1:
            (side,) = stated
            return side, ["The torque at the jaw does not show the side; the names do."]
        reason = "neither names nor signs state the side" if not stated else "the names disagree"
        raise DataError(
            f"{path}: {reason} of the jaw ({named}).",
            "Without a load at the jaw its torque does not show which way closes it.",
            "Name the folder Tool_<n>_<model>_<L|R> after the jaw that was driven.",
        )
    if stated and (RIGHT in stated) != (shown == RIGHT):
        raise DataError(
            f"{path}: the names state one side ({named}), the signs are those of a {shown} jaw.",
            "The load pulls the jaw open, so the sign of torque at the jaw shows the side. With "
            "the wrong side opening would be read as closing; nothing of the file was imported.",
            "Find out which jaw was driven, then correct the folder's name or the header line.",
        )
    remarks = []
    if not stated:
        remarks.append(f"The side is stated nowhere; the signs are those of a {shown} jaw.")
    elif len(stated) == 2:
        remarks.append(f"The names differ ({named}); the signs are those of a {shown} jaw.")
    if shown == RIGHT:
        remarks.append("A right jaw: all signs but the load's were turned, so closing is positive.")
    return shown, remarks


def _shown(columns: FloatArray) -> str | None:
    """Return the side that torque at the jaw shows, or None where no load makes it plain."""
    distal, load = columns[raw.DISTAL, ::THINNING], float(columns[raw.LOAD].mean())
    mean = float(distal.mean())
    if load <= 0.0 or abs(mean) <= float(distal.std()):
        return None
    return LEFT if mean < 0 else RIGHT


def _check_driven(path: Path, columns: FloatArray, side: str) -> None:
    """Refuse a column that acts against the motion it drives."""
    turn = 1.0 if side == LEFT else -1.0
    spindle = -turn * columns[raw.SPINDLE, ::THINNING]
    inside = slice(SPAN, -SPAN)
    if spindle.size <= 2 * SPAN:
        return
    rate = spindle[2 * SPAN :] - spindle[: -2 * SPAN]
    direction = np.sign(rate) * (np.abs(rate) > 0.2 * np.percentile(np.abs(rate), 95))
    wrong = []
    for index, (name, sign) in DRIVEN.items():
        values = turn * sign * columns[index, ::THINNING][inside]
        if _correlation(values, direction) < CONTRADICTION:
            wrong.append(name)
    if wrong:
        raise DataError(
            f"{path}: {', '.join(wrong)} falls where the {side} jaw closes and rises where it "
            "opens: a sign is wrong.",
            "Friction opposes motion, so what drives the spindle is larger in closing.",
            "Correct the sign where the log was written, or the side that its names state.",
        )


def _correlation(a: FloatArray, b: FloatArray) -> float:
    a, b = a - a.mean(), b - b.mean()
    scale = float(np.sqrt((a @ a) * (b @ b)))
    return float(a @ b) / scale if scale > 0 else 0.0


def follows(spindle_rad: FloatArray, geared_rad: FloatArray) -> bool:
    """Return False where an encoder geared to the spindle counts against it."""
    return _correlation(spindle_rad[::THINNING], geared_rad[::THINNING]) >= 0.0
