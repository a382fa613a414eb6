"""Setpoints in a board's number types."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.errors import DriverError
from drivers.teensy.profile import Profile


def whole_setpoints(columns: Sequence[NDArray[np.integer]], profile: Profile) -> list[NDArray[Any]]:
    """Return the fields of setpoints in the board's number types, each of shape (n,).

    Args:
        columns: The fields, in the profile's order.
        profile: Profile of the board.

    Raises:
        DriverError: The arrays do not fit each other or the board's number range.
    """
    names, layout = profile.setpoint_names, profile.setpoint
    if len(columns) != len(names):
        raise DriverError(f"A setpoint has {', '.join(names)}; {len(columns)} were given.")
    whole = [_whole(values, layout[n], n) for n, values in zip(names, columns, strict=True)]
    if len({values.shape for values in whole}) > 1:
        sizes = ", ".join(f"{v.size} of {n}" for n, v in zip(names, whole, strict=True))
        raise DriverError(f"The fields of the setpoints differ in number: {sizes}.")
    return whole


def _whole(values: NDArray[np.integer], kind: np.dtype[Any], name: str) -> NDArray[Any]:
    """Return setpoints in the board's number type.

    Raises:
        DriverError: Not whole numbers in one dimension, or outside the type's range.
    """
    array = np.atleast_1d(np.asarray(values))
    bounds = np.iinfo(kind)
    if not np.issubdtype(array.dtype, np.integer) or array.ndim != 1:
        raise DriverError(
            f"A {name} setpoint is a whole number, not {array.dtype} of {array.ndim} dimensions.",
            fix="Round to counts first.",
        )
    if array.size and not (bounds.min <= array.min() and array.max() <= bounds.max):
        raise DriverError(
            f"A {name} setpoint lies outside {bounds.min}..{bounds.max}.",
            f"The setpoints reach from {array.min()} to {array.max()}.",
        )
    whole: NDArray[Any] = array.astype(kind)
    return whole
