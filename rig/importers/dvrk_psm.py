"""Import measured motion of a da Vinci Research Kit patient-side manipulator.

The text format of WPI-AIM/dvrk_dynamics_identification: 21 columns without a header or a time:
positions, velocities and torques of seven joints, joint 7 being the jaw. The format states no
sample rate; most files have 200 Hz, some 100 Hz, and the file's own velocities show which.

Joints 5 to 7 are logged in motor coordinates; they become dVRK joint coordinates here:
q = M q_motor, and from equal power tau_motor = M^T tau, so tau = M^-T tau_motor (Y. Wang et al., "A
Convex Optimization-Based Dynamic Model Identification Package for the da Vinci Research Kit",
RA-L 4(4), 2019).

Torque is motor current times nominal constants: the arm has no torque sensor.
"""

import lzma
from functools import partial
from pathlib import Path
from typing import BinaryIO, cast

import numpy as np

from estimation.arm.tables import PSM
from estimation.campaign import Campaign, Run
from estimation.recording import FloatArray, Instrument, Recording
from rig.errors import DataError
from rig.importers.derivatives import Relation, relation
from rig.importers.registry import files_ending

USUAL_RATE_HZ = 200.0
RATES_HZ = (50.0, 100.0, 125.0, 200.0, 250.0, 500.0, 1000.0)
JOINTS = 7
COLUMNS = 3 * JOINTS
PRISMATIC_JOINT = 3
ANGULAR = ("angle_rad", "velocity_rad_s", "torque_n_m")
LINEAR = ("position_m", "velocity_m_s", "force_n")
WRIST = slice(4, 7)
MOTOR_TO_JOINT: FloatArray = np.array(PSM.wrist_coupling)
"""M of q_dvrk[5:7] = M q_motor[5:7]."""
MAX_BYTES = 1 << 28
LARGEST = 1e6
SUFFIXES = (".csv", ".csv.xz")
NOTES = (
    "Torque and force are motor current times nominal constants; the arm has no torque sensor. "
    "Joints 5 to 7 were converted from motor to joint coordinates."
)


class PsmImporter:
    """Importer of the dVRK patient-side manipulator's text format."""

    name = "dvrk-psm"
    description = "dVRK arm motion: 21 columns without a header, .csv or .csv.xz"

    def recognises(self, path: Path) -> bool:
        """Whether the path is, or holds, text of 21 numeric columns without a header."""
        return any(_first_line_fits(file) for file in files_ending(path, *SUFFIXES)[:1])

    def open(self, path: Path) -> Campaign:
        """Open a file, or the files of a folder sorted by name, as a campaign.

        Raises:
            DataError: No such file. Reading a run raises DataError where its file is
                damaged, naming file, line and what was expected.
        """
        files = files_ending(path, *SUFFIXES)
        if not files:
            raise DataError(f"{path} holds no .csv or .csv.xz file.")
        return Campaign(tuple(Run(_stem(f), partial(load_run, f), f) for f in files))


IMPORTER = PsmImporter()


def load_run(path: Path) -> Recording:
    """Read one file as a recording.

    Its channels are `joint_<i>_angle_rad`, `joint_<i>_velocity_rad_s` and `joint_<i>_torque_n_m` of
    joints 1 to 7; joint 3 has `joint_3_position_m`, `joint_3_velocity_m_s`, `joint_3_force_n`.

    Raises:
        DataError: The file is damaged; names the file, the line and what was expected.
    """
    values = _numbers(path, _content(path))
    rate_hz, remark = _sample_rate(path, values)
    position, velocity, torque = values.reshape(3, JOINTS, -1)
    for motion in (position, velocity):
        motion[WRIST] = MOTOR_TO_JOINT @ motion[WRIST]
    torque[WRIST] = np.linalg.solve(MOTOR_TO_JOINT.T, torque[WRIST])
    columns = {}
    for joint in range(1, JOINTS + 1):
        units = LINEAR if joint == PRISMATIC_JOINT else ANGULAR
        for unit, block in zip(units, (position, velocity, torque), strict=True):
            columns[f"joint_{joint}_{unit}"] = block[joint - 1]
    return Recording(
        name=_stem(path),
        time_s=np.arange(values.shape[1]) / rate_hz,
        columns=columns,
        rig="dVRK patient-side manipulator",
        instrument=Instrument(),
        notes=f"{NOTES} {remark}",
        source=str(path),
    )


def _sample_rate(path: Path, values: FloatArray) -> tuple[float, str]:
    """Return the rate at which positions change as the velocities state, Hz, and how it was found.

    Raises:
        DataError: The joints imply different rates, or one that no such log has.
    """
    time_s = np.arange(values.shape[1]) / USUAL_RATE_HZ
    found: dict[int, Relation] = {}
    for joint in range(1, JOINTS + 1):
        motion = {"angle_rad": values[joint - 1], "velocity_rad_s": values[JOINTS + joint - 1]}
        pair = Recording("pair", time_s, motion)
        one = relation(pair, "angle_rad", "velocity_rad_s")
        if one is not None:
            found[joint] = one
    if not found:
        return USUAL_RATE_HZ, (
            f"The motion does not show the sample rate; the usual {USUAL_RATE_HZ:g} Hz is assumed."
        )
    implied_hz = {joint: USUAL_RATE_HZ / abs(one.ratio) for joint, one in found.items()}
    middle_hz = float(np.median(list(implied_hz.values())))
    rate_hz = min(RATES_HZ, key=lambda rate: abs(np.log(rate / middle_hz)))
    off = [joint for joint, one in found.items() if not one.allows(USUAL_RATE_HZ / rate_hz)]
    if off:
        joints = ", ".join(f"joint {joint} {implied_hz[joint]:.1f} Hz" for joint in off)
        raise DataError(
            f"{path}: the velocities imply different sample rates: {joints}, where the median is "
            f"{middle_hz:.1f} Hz.",
            f"Expected one of {', '.join(f'{rate:g}' for rate in RATES_HZ)} Hz in every joint. The "
            "format states no rate, so nothing of the file was imported.",
            "Restore the file from its source.",
        )
    return rate_hz, f"Sample rate by the file's own velocities: {rate_hz:g} Hz."


def _opened(path: Path) -> BinaryIO:
    return cast(BinaryIO, lzma.open(path)) if path.suffix.lower() == ".xz" else path.open("rb")


def _content(path: Path) -> str:
    """Return the text of a file, unpacked and limited in size."""
    try:
        with _opened(path) as file:
            content = file.read(MAX_BYTES + 1)
    except (OSError, EOFError, lzma.LZMAError) as error:
        raise DataError(
            f"{path} cannot be read: {error}.",
            "Expected a whole .csv or .csv.xz file; nothing of it was imported.",
            "Copy it again from its source.",
        ) from error
    if len(content) > MAX_BYTES:
        raise DataError(f"{path} holds more than {MAX_BYTES >> 20} MB of text.")
    return content.decode("latin-1")


def _numbers(path: Path, text: str) -> FloatArray:
    """Return the columns, shape (21, n)."""
    lines = text.replace("\r\n", "\n").split("\n")
    if lines.pop():
        raise _fault(path, len(lines) + 1, "the file ends inside the line", "a line end")
    if len(lines) < 2:
        raise _fault(path, len(lines), f"there are {len(lines)} samples", "at least two")
    rows = np.empty((len(lines), COLUMNS))
    for number, line in enumerate(lines, 1):
        fields = line.split(",")
        if len(fields) != COLUMNS:
            expected = f"{COLUMNS} (position, velocity and torque of {JOINTS} joints)"
            raise _fault(path, number, f"the line has {len(fields)} columns", expected)
        try:
            rows[number - 1] = [float(field) for field in fields]
        except ValueError as error:
            raise _fault(path, number, str(error), "a number in each column") from None
    bad = ~(np.abs(rows) <= LARGEST).all(axis=1)  # true for NaN and infinity too
    if bad.any():
        row = int(np.argmax(bad)) + 1
        raise _fault(path, row, "a value is not finite or absurd", f"|x| <= {LARGEST:g}")
    return np.ascontiguousarray(rows.T)


def _fault(path: Path, line: int, what: str, expected: str) -> DataError:
    return DataError(
        f"{path}, line {line}: {what}.",
        f"Expected {expected}. Nothing of the file was imported.",
        "Copy the file again from its source.",
    )


def _stem(path: Path) -> str:
    return path.name[: path.name.lower().rindex(".csv")]


def _first_line_fits(path: Path) -> bool:
    try:
        with _opened(path) as file:
            fields = file.readline(1 << 14).split(b",")
        return len([float(field) for field in fields]) == COLUMNS
    except (OSError, EOFError, lzma.LZMAError, ValueError):
        return False
