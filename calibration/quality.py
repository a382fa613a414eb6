"""What bad calibration data looks like: each check passes, or refuses with a reason."""

import numpy as np
from numpy.typing import ArrayLike

from calibration.errors import CalibrationError
from estimation.recording import FloatArray

SATURATED_SHARE = 0.01
"""Largest share of samples at a rail that passes."""

CLIPPED_SHARE = 0.05
"""Largest share of samples that may have exactly the greatest value of all."""

LEVEL_BINS = 20
"""A level is one of this many equal parts of the range that holds samples."""


class BadDataError(CalibrationError):
    """The data cannot carry a calibration.

    Attributes:
        rule: `points`, `levels`, `no_change`, `saturated`, `clipped`, `drift`, `hysteresis`,
            `not_monotone`, `not_linear` or `not_steady`.
    """

    def __init__(self, rule: str, what: str, why: str = "", fix: str = "") -> None:
        self.rule = rule
        super().__init__(what, why, fix)


def finite(values: ArrayLike, name: str) -> FloatArray:
    """Return values as a float array of shape (n,).

    Raises:
        BadDataError: They have another shape, or one of them is not a number.
    """
    array = np.asarray(values, dtype=np.float64)
    if array.ndim != 1 or not np.isfinite(array).all():
        raise BadDataError("points", f"{name} is not a row of finite numbers.")
    return array


def check_points(count: int, least: int, name: str) -> None:
    """Refuse too few points."""
    if count < least:
        raise BadDataError("points", f"Too few {name}: {count}.", f"At least {least} are needed.")


def check_levels(values: FloatArray, least: int, name: str) -> None:
    """Refuse values that stand in too few places of their range."""
    low, high = float(values.min()), float(values.max())
    span = (high - low) or 1.0
    bins = np.minimum((values - low) / span * LEVEL_BINS, LEVEL_BINS - 1).astype(int)
    levels = len(np.unique(bins))
    if levels < least:
        raise BadDataError(
            "levels",
            f"{name} has {levels} levels.",
            f"At least {least} are needed between {low:g} and {high:g}.",
            "Load in more steps, or sweep slowly through the range.",
        )


def check_change(values: FloatArray, least: float, name: str) -> None:
    """Refuse values with too little change."""
    span = float(np.ptp(values))
    if not span >= least:
        raise BadDataError(
            "no_change",
            f"{name} changes by {span:.4g} only.",
            f"At least {least:.4g} is needed.",
            "Check that the sensor is connected and loaded.",
        )


def check_rails(
    values: FloatArray, low: float | None, high: float | None, name: str, *, pile_up: bool = True
) -> None:
    """Refuse readings, shape (n,), at a rail, or piled up at their greatest value as if cut off.

    A rail is None where it is unknown or rest is there anyway. The pile-up is looked for in a
    sweep, not in readings at rest, which are all alike.
    """
    for rail, sign in ((low, -1.0), (high, 1.0)):
        share = 0.0 if rail is None else float(np.mean(sign * values >= sign * rail))
        if share > SATURATED_SHARE:
            raise BadDataError(
                "saturated",
                f"{share:.0%} of {name} are at the rail {rail:g}.",
                "What lies beyond a rail is not measured.",
                "Load less, or reduce the amplifier's gain.",
            )
    share = float(np.mean(values == values.max()))
    if pile_up and values.size >= 2 * LEVEL_BINS and share > CLIPPED_SHARE:
        raise BadDataError(
            "clipped",
            f"{share:.0%} of {name} have exactly the greatest value, {values.max():g}.",
            "Something on the way cuts the range off.",
            "Look at the amplifier's and the converter's range.",
        )


def check_limit(rule: str, value: float, limit: float, what: str, fix: str) -> None:
    """Refuse a measure beyond its limit, both as shares of the span."""
    if not value <= limit:
        raise BadDataError(
            rule, f"{what} is {value:.1%} of the span.", f"At most {limit:.1%} passes.", fix
        )
