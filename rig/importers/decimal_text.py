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
    UNTERMINATED = 5  # the text ends inside a line


MAX_DIGITS = 15
_POWERS = 10.0 ** np.arange(MAX_DIGITS + 1)
_NEWLINE, _RETURN, _COMMA, _POINT, _PLUS, _MINUS, _ZERO = 10, 13, 44, 46, 43, 45, 48


@numba.njit(cache=True)
def parse_decimals(
    text: NDArray[np.uint8], columns: NDArray[np.float64]
) -> tuple[int, int, int, int]:
    """Parse decimal text into columns, one pass over the bytes.

    Args:
        text: Bytes of the lines, shape (bytes,).
        columns: Filled in place, shape (number of columns, rows); rows is at least the number of
            line ends in the text.

    Returns:
        Fault (0 when the whole text was parsed), complete rows before it, column of the fault and
        byte position of the fault.
    """
    width, row, column = columns.shape[0], 0, 0
    position, size = 0, text.size
    while position < size:
        negative = text[position] == _MINUS
        if negative or text[position] == _PLUS:
            position += 1
        mantissa, digits, decimals, point = 0, 0, 0, False
        while position < size:
            digit = np.int64(text[position]) - _ZERO
            if 0 <= digit <= 9:
                mantissa = mantissa * 10 + digit
                digits += 1
                decimals += point
                if digits > MAX_DIGITS:
                    return 4, row, column, position
            elif text[position] == _POINT and not point:
                point = True
            else:
                break
            position += 1
        if position == size:
            return 5, row, column, position
        if digits == 0:
            return 1, row, column, position
        if column == width:
            return 3, row, column, position
        value = mantissa / _POWERS[decimals]
        columns[column, row] = -value if negative else value
        column += 1
        if text[position] == _COMMA:
            position += 1
            if position == size:
                return 5, row, column, position
            continue
        if text[position] == _RETURN:
            position += 1
            if position == size:
                return 5, row, column, position
        if text[position] != _NEWLINE:
            return 1, row, column - 1, position
        if column < width:
            return 2, row, column, position
        position += 1
        row += 1
        column = 0
    return 0, row, 0, position
