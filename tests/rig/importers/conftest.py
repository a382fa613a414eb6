"""Synthetic MRDLab logs, written the way the rig writes them (raw signs, counts)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
import pytest

from rig.importers.mat5 import Unread
from rig.importers.mrdlab import IMPORTER

COLUMN_LINE = (
    "%Back-end Time [ms], Back-end CUI Encoder [counts], Back-end Futek Torque [counts], "
    "Measured Current [Amps], Front-end Maxon Encoder [counts], Front-end Futek Torque [counts], "
    "Front-end Command [amps?], Back-end Command [-1:1], Back-end Maxon [counts], "
    "Trajectory Target [counts?]"
)
TOOL_LINE = (
    "%Used left spindle of tool number 4 Lot N10150901 729 with a 9.99 Hz Sine wave was "
    "implemented with and amplitude of 30.00 degrees, and a reaction torque of 99.00 percent torque"
)
MIRRORED = [1, 2, 3, 4, 5, 7, 8, 9]
"""Columns whose sign is another on a right jaw: all but time and the load's command."""


@dataclass
class Log:
    """What a synthetic log holds; `text()` writes it."""

    seconds: float = 4.0
    frequency_hz: float = 0.5
    load_a: float = 0.2
    header: Sequence[str] = ("%taken by a test", TOOL_LINE, "%idxPulse_0=0")
    target: str = "counts"  # or "rad", "zeros", "nonsense"
    command_decimals: int = 4
    motor_zero: int = -5888
    time_scale: float = 1.0
    first_s: float = 0.0
    mirrored: bool = False
    """Written as a right jaw's rig does: every measured and commanded sign turned."""
    edit: Callable[[np.ndarray], None] = field(default=lambda rows: None)

    def rows(self) -> np.ndarray:
        """Return raw values, shape (n, 10)."""
        t = np.arange(round(self.seconds * 1000)) / 1000
        # raw: the spindle starts open at 1365 counts and falls while the jaw closes
        spindle = np.rint(682.67 * (1 + np.cos(2 * np.pi * self.frequency_hz * t)))
        closing = 1365.33 - spindle
        # a spring and friction
        torque = np.rint(2 * closing + 800 * np.sign(np.gradient(closing)))
        target = {
            "counts": spindle,
            "rad": spindle * 2 * np.pi / 8192,
            "zeros": 0 * spindle,
            "nonsense": -spindle,
        }[self.target]
        current = 0.05 + torque * 5e-5
        rows = np.column_stack(
            [
                t + self.first_s,
                spindle,
                torque,
                current,
                np.rint(189 + 0.5 * closing),
                np.rint(-200 - torque / 2),
                np.full_like(t, self.load_a),
                -(current + 0.019) / 2.06,
                np.rint(self.motor_zero - 17.5 * spindle + 17.5 * 1365.33),
                target,
            ]
        )
        self.edit(rows)
        if self.mirrored:
            rows[:, MIRRORED] *= -1
        rows[:, 0] *= self.time_scale
        return rows

    def text(self) -> str:
        c = self.command_decimals
        formats = ["%.3f", "%d", "%d", "%.4f", "%d", "%d", "%.4f", f"%.{c}f", "%d", "%.4f"]
        lines = [",".join(f % v for f, v in zip(formats, row, strict=True)) for row in self.rows()]
        return "\n".join([*self.header, COLUMN_LINE, *lines]) + "\n"


@pytest.fixture(scope="session")
def make_log() -> type[Log]:
    """The builder of synthetic logs."""
    return Log


@pytest.fixture
def load(tmp_path):
    """Write one log into a folder, import it and return its recording."""

    def _load(folder="Tool_4_Maryland_L_4", spindle="left", stem="00", **options):
        log = Log(**options)
        log.header = [line.replace("left spindle", f"{spindle} spindle") for line in log.header]
        path = tmp_path / folder / f"{stem}.TXT"
        path.parent.mkdir(exist_ok=True)
        path.write_text(log.text())
        return IMPORTER.open(path).runs[0].recording()

    return _load


def agree(ours, theirs):
    """Whether two readers of a MATLAB file give equal values; one not read counts as equal."""
    if isinstance(ours, dict):
        if isinstance(theirs, list):  # an array of structs
            theirs = {str(k + 1): one for k, one in enumerate(theirs)}
        return all(agree(value, theirs[name]) for name, value in ours.items())
    if isinstance(ours, Unread | str):
        return isinstance(ours, Unread) or ours == theirs
    return np.array_equal(ours, theirs)


def text_table(path, columns, separator=","):
    """Write columns as a text table, and return its path."""
    rows = [[repr(float(v)) for v in row] for row in zip(*columns.values(), strict=True)]
    path.write_text("".join(separator.join(line) + "\n" for line in [columns, *rows]))
    return path
