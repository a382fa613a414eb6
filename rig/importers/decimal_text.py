"""Fast, strict parser of comma-separated decimal text.

The grammar is small on purpose: `[+-]digits[.digits]`, a fixed number of columns, LF or CR LF, and
every line ended. Values are correctly rounded: up to 15 digits are an exact integer in float64 and
the power of ten below it is exact too, so one division rounds once, as Python's `float` does.
"""

from enum import IntEnum

import numba
import numpy as np
from numpy.typing import NDArray


class Fault(IntEnum):
    """What stopped the parser."""

    NONE = 0
    NOT_A_NUMBER = 1  # a character outside the grammar, or an empty field
    TOO_FEW_COLUMNS = 2
    TOO_MANY_COLUMNS = 3
    TOO_MANY_DIGITS = 4  # more than 15: float64 could not hold them exactly
    TOO_MANY_ROWS = 5  # more lines than the caller made room for


MAX_DIGITS = 15
_POWERS = 10.0 ** np.arange(MAX_DIGITS + 1)
_NEWLINE, _RETURN, _COMMA, _POINT, _PLUS, _MINUS, _ZERO = 10, 13, 44, 46, 43, 45, 48


@numba.njit(cache=True)
def parse_decimals(
    text: NDArray[np.uint8], columns: NDArray[np.float64]
) -> tuple[int, int, int, int]:
    """Parse decimal text into columns, one pass over the bytes.

    Args:
        text: Bytes of the lines, shape (bytes,); the last one must be a line feed, which is the
            sentinel that stops every loop.
        columns: Filled in place, shape (number of columns, rows).

    Returns:
        Fault (0 when the whole text was parsed), complete rows before it, column of the fault and
        byte position of the fault.
    """
    width, room = columns.shape
    row, column = 0, 0
    one = np.uint64(1)  # unsigned positions: no wrap-around test at each access
    position, size = np.uint64(0), np.uint64(text.size)
    while position < size:
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
        if column == width:
            return 3, row, column, int(position)
        if digits == 0:
            return 1, row, column, int(position)
        if digits > MAX_DIGITS:
            return 4, row, column, int(position)
        if row == room:
            return 5, row, column, int(position)
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
        if end != _NEWLINE:
            return 1, row, column - 1, int(position)
        if column < width:
            return 2, row, column, int(position)
        position += one
        row += 1
        column = 0
    return 0, row, 0, int(position)
