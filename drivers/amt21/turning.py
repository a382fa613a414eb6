"""Where a shaft stands that turns while it is asked, and whether it can have got there."""

import math

from drivers.amt21.protocol import FULL_TURN

TOP_SPEED_RAD_S = 8000 * 2 * math.pi / 60
"""The fastest shaft of the series: 8000 turns a minute for the 12-bit types, 4000 for 14 bits."""
TURN_NUMBERS = FULL_TURN
"""Turns are counted in 14 bits, and wrap."""
_PLAY_COUNTS = 4
"""Counts a shaft at rest may differ by from one reading to the next."""


def turns_at(angle: int, before: int, after: int) -> int | None:
    """Return the turns that go with an angle, from the turns asked before and after it.

    The shaft has moved less than half a turn in between: where the turns differ by one, the angle
    says by its half of the turn on which side of the wrap it was read.

    Args:
        angle: The angle's 14-bit value.
        before: The turns asked before it, 14-bit value.
        after: The turns asked after it.

    Returns:
        A 14-bit value, None when the turns are further apart than one.
    """
    step = (after - before) % TURN_NUMBERS
    if step == 0:
        return before
    in_lower_half = angle < FULL_TURN // 2
    if step == 1:
        return after if in_lower_half else before
    if step == TURN_NUMBERS - 1:
        return before if in_lower_half else after
    return None


class RateGate:
    """Refuses a position that is further from the last one than the shaft can have turned.

    Two check bits let one damaged answer in four pass.

    Args:
        top_speed_rad_s: The fastest the shaft turns.
        multi_turn: Whether positions count turns; else they wrap at each turn.
    """

    def __init__(self, top_speed_rad_s: float, multi_turn: bool) -> None:
        self._counts_a_second = top_speed_rad_s / (2 * math.pi) * FULL_TURN
        self._wrap = FULL_TURN * (TURN_NUMBERS if multi_turn else 1)
        self._last: tuple[int, float] | None = None

    def restart(self) -> None:
        """Take the next position as it is."""
        self._last = None

    def fits(self, position: int, now_s: float) -> bool:
        """Return whether the shaft can be at `position`, counts, at this time."""
        if self._last is None:
            return True
        last, then_s = self._last
        return self.is_near(position, last, now_s - then_s)

    def is_near(self, position: int, other: int, apart_s: float) -> bool:
        """Return whether the shaft can have turned from one position to the other in that time."""
        half = self._wrap // 2
        moved = abs((position - other + half) % self._wrap - half)
        return moved <= apart_s * self._counts_a_second + _PLAY_COUNTS

    def accept(self, position: int, now_s: float) -> None:
        """Take a position for good."""
        self._last = (position, now_s)
