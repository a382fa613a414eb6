"""Read the text of one MRDLab log: header lines, ten columns of decimals, every fault by line.

The grammar of a number is small on purpose: `[+-]digits[.digits]`. Values are correctly rounded: up
to 15 digits are an exact integer in float64 and the power of ten below it is exact too, so one
division rounds once, as Python's `float` does. Lines end in LF or CR LF.
"""

import re
from dataclasses import dataclass
from pathlib import Path

import numba
import numpy as np
from numpy.typing import NDArray

from estimation.recording import FloatArray
from rig.errors import DataError

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
MAX_DIGITS = 15
DIGITS = [bytes([digit]) for digit in b"0123456789"]
DECIMAL = re.compile(rb"[+-]?(\d+\.?\d*|\.\d+)")
STEP_S = 1e-3
STEP_TOLERANCE_RATIO = 0.01


@dataclass(frozen=True, slots=True)
class Text:
    """One log as it was written."""

    header: str  # the `%` lines, without the signs
    columns: FloatArray  # raw values in the file's column order, shape (10, n); time in seconds
    header_lines: int


def looks_like_log(first_bytes: bytes) -> bool:
    """Whether the first bytes of a file are those of an MRDLab log."""
    return first_bytes[:1] == b"%" and b"Back-end" in first_bytes


class _Fault(Exception):  # noqa: N818  an error is made of it where the path is known
    """What is wrong in a line, and what was expected there."""

    def __init__(self, line: int, what: str, expected: str = "a whole MRDLab log") -> None:
        super().__init__(line, what, expected)


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
    try:
        lines, start = _header(content)
        columns = _parse(content, start, len(lines))
        _check_range(columns, len(lines))
        columns[TIME] = _seconds(columns[TIME], len(lines))
    except _Fault as fault:
        line, what, expected = fault.args
        raise DataError(
            f"{path}, line {line}: {what}.",
            f"Expected {expected}. Nothing of the file was imported.",
            "Restore the file from its source, omit it (fit, diagnose, view: --skip-bad), or name"
            " the format with --format if it is another one.",
        ) from None
    return Text("\n".join(lines), columns, len(lines))


def _header(content: bytes) -> tuple[list[str], int]:
    """Return the header lines and the position of the first sample; count, never assume."""
    lines: list[str] = []
    position = 0
    while content[position : position + 1] == b"%":
        end = content.find(b"\n", position)
        if end < 0:
            raise _Fault(len(lines) + 1, "the file ends inside its header")
        lines.append(content[position + 1 : end].decode("latin-1").strip())
        position = end + 1
    if not lines:
        raise _Fault(1, "there is no header", "header lines that start with %")
    named = lines[-1].split(",")
    if len(named) != len(COLUMNS):
        expected = f"{len(COLUMNS)} columns: {', '.join(name for name, _, _ in COLUMNS)}"
        what = f"the last header line names {len(named)} columns"
        raise _Fault(len(lines), what, expected)
    for number, (text, (name, word, _)) in enumerate(zip(named, COLUMNS, strict=True), 1):
        if word not in text.lower():
            raise _Fault(len(lines), f"column {number} is named {text.strip()!r}", f"{name!r}")
    return lines, position


def _parse(content: bytes, start: int, header_lines: int) -> FloatArray:
    if not content.endswith(b"\n"):
        last = content.rsplit(b"\n", 1)[-1][:40].decode("latin-1")
        expected = f"{len(COLUMNS)} decimal numbers and a line end; the file is truncated"
        what = f"the file ends inside the line: {last!r}"
        raise _Fault(content.count(b"\n") + 1, what, expected)
    text = np.frombuffer(content, np.uint8, offset=start)
    columns = np.empty((len(COLUMNS), content.count(b"\n", start)))
    row, position = parse_decimals(text, columns)
    if position < text.size:
        line = content[start + position : content.index(b"\n", start + position)]
        raise _Fault(header_lines + row + 1, *_wrong_in(line))
    if row < 2:
        raise _Fault(header_lines + row + 1, f"the log holds {row} samples", "at least two samples")
    return columns[:, :row]


def _wrong_in(line: bytes) -> tuple[str, str]:
    """Return the fault of a line that was not parsed, and what was expected."""
    fields = line.removesuffix(b"\r").split(b",")
    for column, (field, (name, _, _)) in enumerate(zip(fields, COLUMNS, strict=False), 1):
        what = f"column {column} is {field[:40].decode('latin-1')!r}"
        if DECIMAL.fullmatch(field) is None:
            return what, f"a decimal number, {name}"
        if sum(map(field.count, DIGITS)) > MAX_DIGITS:
            return what, f"{name} of at most {MAX_DIGITS} digits"
    width = len(COLUMNS)
    has = f"{len(fields)}" if len(fields) < width else f"more than {width}"
    return f"the line has {has} columns", f"{width} decimal numbers with commas between them"


def _check_range(columns: FloatArray, header_lines: int) -> None:
    highest, lowest = columns.max(axis=1), columns.min(axis=1)
    for values, high, low, (name, _, largest) in zip(
        columns, highest, lowest, COLUMNS, strict=True
    ):
        if high > largest or low < -largest:
            row = int(np.argmax(np.abs(values) > largest))
            expected = f"a value between -{largest:g} and {largest:g}"
            raise _Fault(header_lines + row + 1, f"{name} is {values[row]:g}", expected)


def _seconds(time: FloatArray, header_lines: int) -> FloatArray:
    """Return time in seconds: the header has ms, the values step by 0.001; use the step."""
    steps: NDArray[np.float64] = np.diff(time)
    if steps.min() <= 0:
        row = int(np.argmax(steps <= 0)) + 1
        what = f"time goes from {time[row - 1]:g} to {time[row]:g}"
        raise _Fault(header_lines + row + 1, what, "a time that increases at every line")
    step = float(np.median(steps[:1001]))
    for unit_s in (1.0, 1e-3):
        if abs(step * unit_s / STEP_S - 1) < STEP_TOLERANCE_RATIO:
            return time if unit_s == 1.0 else time * unit_s
    expected = "steps of 1 ms, written as 0.001 (s) or as 1 (ms)"
    raise _Fault(header_lines + 2, f"time steps by {step:g}", expected)


_POWERS = 10.0 ** np.arange(MAX_DIGITS + 1)
_NEWLINE, _RETURN, _COMMA, _POINT, _PLUS, _MINUS, _ZERO = 10, 13, 44, 46, 43, 45, 48


@numba.njit(cache=True)
def parse_decimals(text: NDArray[np.uint8], columns: NDArray[np.float64]) -> tuple[int, int]:
    """Parse decimal text into columns, one pass over the bytes.

    Args:
        text: Bytes of the lines, shape (bytes,); the last one must be a line feed, which is the
            sentinel that stops every loop.
        columns: Filled in place, shape (number of columns, rows).

    Returns:
        Complete rows, and the byte at which the line after them begins. That is the text's end, or
        the first line that is not a row of decimals, or for which there is no room.
    """
    width, room = columns.shape
    row, column = 0, 0
    one = np.uint64(1)  # unsigned positions: no wrap-around test at each access
    position, size = np.uint64(0), np.uint64(text.size)
    line = position
    while position < size and row < room:
        sign = text[position]
        position += np.uint64((sign == _MINUS) | (sign == _PLUS))
        first = position
        mantissa = np.int64(0)
        digit = np.int64(text[position]) - _ZERO
        while 0 <= digit <= 9:
            mantissa = mantissa * 10 + digit
            position += one
            digit = np.int64(text[position]) - _ZERO
        digits = np.int64(position - first)
        decimals = np.int64(0)
        if text[position] == _POINT:
            position += one
            first = position
            digit = np.int64(text[position]) - _ZERO
            while 0 <= digit <= 9:
                mantissa = mantissa * 10 + digit
                position += one
                digit = np.int64(text[position]) - _ZERO
            decimals = np.int64(position - first)
            digits += decimals
        if column == width or digits == 0 or digits > MAX_DIGITS:
            break
        value = np.float64(mantissa)
        if decimals > 0:
            value /= _POWERS[decimals]
        columns[column, row] = -value if sign == _MINUS else value
        column += 1
        end = text[position]
        if end == _COMMA:
            position += one
            continue
        if end == _RETURN:
            position += one
            end = text[position]
        if end != _NEWLINE or column < width:
            break
        position += one
        line = position
        row += 1
        column = 0
    return row, int(line)
