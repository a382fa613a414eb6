"""Read the text of one MRDLab log: header lines, ten columns of decimals, every fault by line."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from estimation.recording import FloatArray
from rig.errors import DataError
from rig.importers.decimal_text import MAX_DIGITS, Fault, parse_decimals

COLUMNS = (
    ("Back-end Time", "time", 1e7),
    ("Back-end CUI Encoder", "cui", 1e9),
    ("Back-end Futek Torque", "futek", 1e9),
    ("Measured Current", "current", 1e3),
    ("Front-end Maxon Encoder", "maxon", 1e9),
    ("Front-end Futek Torque", "futek", 1e9),
    ("Front-end Command", "command", 1e3),
    ("Back-end Command", "command", 1e3),
    ("Back-end Maxon", "maxon", 1e9),
    ("Trajectory Target", "target", 1e9),
)
"""Name of each column, the word that identifies it in a header, its largest credible value."""
TIME, SPINDLE, PROXIMAL, CURRENT, JAW, DISTAL, LOAD, COMMAND, MOTOR, TARGET = range(10)
MIRRORED = [SPINDLE, PROXIMAL, CURRENT, JAW, DISTAL, COMMAND, MOTOR, TARGET]
"""Columns whose sign on a right jaw is opposite to that on a left one."""

MAX_BYTES = 1 << 30
STEP_S = 1e-3
STEP_TOLERANCE_RATIO = 0.01


@dataclass(frozen=True, slots=True)
class Text:
    """One log as it was written.

    Attributes:
        header: The `%` lines, without the signs.
        columns: Raw values in the file's column order, shape (10, n); time in seconds.
        header_lines: Number of header lines.
    """

    header: str
    columns: FloatArray
    header_lines: int


def looks_like_log(first_bytes: bytes) -> bool:
    """Whether the first bytes of a file are those of an MRDLab log."""
    return first_bytes[:1] == b"%" and b"Back-end" in first_bytes


def read_text(path: Path) -> Text:
    """Read and check one log.

    Raises:
        DataError: The file is not a whole log; names the file, the line and what was expected.
    """
    try:
        size = path.stat().st_size
        if size > MAX_BYTES:
            raise DataError(
                f"{path} has {size >> 20} MB, more than the {MAX_BYTES >> 20} MB a log may have.",
                "A 20 s run has about 1.2 MB.",
            )
        content = path.read_bytes()
    except OSError as error:
        raise DataError(f"{path} cannot be read: {error.strerror}.") from error
    lines, start = _header(path, content)
    columns = _parse(path, content, start, len(lines))
    _check_range(path, columns, len(lines))
    columns[TIME] = _seconds(path, columns[TIME], len(lines))
    return Text("\n".join(lines), columns, len(lines))


def _header(path: Path, content: bytes) -> tuple[list[str], int]:
    """Return the header lines and the position of the first sample; count, never assume."""
    lines: list[str] = []
    position = 0
    while content[position : position + 1] == b"%":
        end = content.find(b"\n", position)
        if end < 0:
            raise _fault(path, len(lines) + 1, "the file ends inside its header")
        lines.append(content[position + 1 : end].decode("latin-1").strip())
        position = end + 1
    if not lines:
        raise _fault(path, 1, "there is no header", "header lines that start with %")
    named = lines[-1].split(",")
    if len(named) != len(COLUMNS):
        raise _fault(
            path,
            len(lines),
            f"the last header line names {len(named)} columns",
            f"{len(COLUMNS)} columns: {', '.join(name for name, _, _ in COLUMNS)}",
        )
    for number, (text, (name, word, _)) in enumerate(zip(named, COLUMNS, strict=True), 1):
        if word not in text.lower():
            raise _fault(
                path, len(lines), f"column {number} is named {text.strip()!r}", f"{name!r}"
            )
    return lines, position


def _parse(path: Path, content: bytes, start: int, header_lines: int) -> FloatArray:
    if not content.endswith(b"\n"):
        last = content.rsplit(b"\n", 1)[-1][:40].decode("latin-1")
        raise _fault(
            path,
            content.count(b"\n") + 1,
            f"the file ends inside the line: {last!r}",
            f"{len(COLUMNS)} decimal numbers and a line end; the file is truncated",
        )
    text = np.frombuffer(content, np.uint8, offset=start)
    columns = np.empty((len(COLUMNS), _likely_rows(content, start)))
    fault, row, column, position = parse_decimals(text, columns)
    if fault == Fault.TOO_MANY_ROWS:
        columns = np.empty((len(COLUMNS), content.count(b"\n", start)))
        fault, row, column, position = parse_decimals(text, columns)
    if fault != Fault.NONE:
        raise _parse_fault(path, content, start + position, fault, column, header_lines + row + 1)
    if row < 2:
        raise _fault(
            path, header_lines + row + 1, f"the log holds {row} samples", "at least two samples"
        )
    return columns[:, :row]


def _likely_rows(content: bytes, start: int) -> int:
    """Return a little more than the number of lines, judged by the first ones: no second pass."""
    sample = content[start : start + 4096]
    return 16 + sample.count(b"\n") * (len(content) - start) * 11 // (10 * max(len(sample), 1))


def _parse_fault(
    path: Path, content: bytes, position: int, fault: int, column: int, line: int
) -> DataError:
    expected = f"{len(COLUMNS)} decimal numbers with commas between them"
    if fault == Fault.TOO_FEW_COLUMNS:
        return _fault(path, line, f"the line has {column} columns", expected)
    if fault == Fault.TOO_MANY_COLUMNS:
        return _fault(path, line, f"the line has more than {column} columns", expected)
    first = max(content.rfind(b",", 0, position), content.rfind(b"\n", 0, position)) + 1
    field = content[first : content.index(b"\n", position)].split(b",")[0][:40].decode("latin-1")
    name = COLUMNS[column][0]
    if fault == Fault.TOO_MANY_DIGITS:
        return _fault(
            path,
            line,
            f"column {column + 1} is {field!r}",
            f"{name} of at most {MAX_DIGITS} digits",
        )
    return _fault(path, line, f"column {column + 1} is {field!r}", f"a decimal number, {name}")


def _check_range(path: Path, columns: FloatArray, header_lines: int) -> None:
    highest, lowest = columns.max(axis=1), columns.min(axis=1)
    for values, high, low, (name, _, largest) in zip(
        columns, highest, lowest, COLUMNS, strict=True
    ):
        if high > largest or low < -largest:
            row = int(np.argmax(np.abs(values) > largest))
            raise _fault(
                path,
                header_lines + row + 1,
                f"{name} is {values[row]:g}",
                f"a value between -{largest:g} and {largest:g}",
            )


def _seconds(path: Path, time: FloatArray, header_lines: int) -> FloatArray:
    """Return time in seconds: the header has ms, the values step by 0.001; use the step."""
    steps: NDArray[np.float64] = np.diff(time)
    if steps.min() <= 0:
        row = int(np.argmax(steps <= 0)) + 1
        raise _fault(
            path,
            header_lines + row + 1,
            f"time goes from {time[row - 1]:g} to {time[row]:g}",
            "a time that increases at every line",
        )
    step = float(np.median(steps[:1001]))
    for unit_s in (1.0, 1e-3):
        if abs(step * unit_s / STEP_S - 1) < STEP_TOLERANCE_RATIO:
            return time if unit_s == 1.0 else time * unit_s
    raise _fault(
        path,
        header_lines + 2,
        f"time steps by {step:g}",
        "steps of 1 ms, written as 0.001 (s) or as 1 (ms)",
    )


def _fault(path: Path, line: int, what: str, expected: str = "a whole MRDLab log") -> DataError:
    return DataError(
        f"{path}, line {line}: {what}.",
        f"Expected {expected}. Nothing of the file was imported.",
        "Restore the file from its source, omit it (fit, diagnose, view: --skip-bad), or name the"
        " format with --format if it is another one.",
    )
