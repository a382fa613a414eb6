"""What a board in Python does a tick, by profile: the part of `PythonBoard` that differs."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from drivers.teensy.profile import Profile


class BoardDrive(Protocol):
    """All that a tick of a board needs and changes, besides its inputs.

    Attributes:
        guard: State of the guard, int64, beginning with the places of `drivers.teensy.watches`.
        limits: The limits it was armed with, in the order of the wire, int64.
    """

    @property
    def guard(self) -> NDArray[np.int64]: ...  # noqa: D102
    @property
    def limits(self) -> NDArray[np.int64]: ...  # noqa: D102


@dataclass(frozen=True, eq=False)
class BoardLogic:
    """One profile's logic.

    Attributes:
        profile: The profile.
        idle: Gives a drive that was never armed.
        armed: Gives a drive just armed with gains, shape (motors, 5), and limits.
        limits_are_valid: Whether a board takes these limits, in the order of the wire.
        allows: Whether limits allow all of some setpoints, shape (n, fields).
        columns: Field of a sample to the column of a tick's row.
        status_column: Column of the board's state.
        converted: Column of each converter to the counts from which down and up it is saturated.
    """

    profile: Profile
    idle: Callable[[], BoardDrive]
    armed: Callable[[NDArray[np.float64], Sequence[int]], BoardDrive]
    limits_are_valid: Callable[[Sequence[int]], bool]
    allows: Callable[[NDArray[np.int64], NDArray[np.int64]], bool]
    columns: Mapping[str, int]
    status_column: int
    converted: Mapping[int, tuple[int, int]]

    def samples(self, counts: NDArray[np.int32]) -> NDArray[Any]:
        """Return samples with the counts of some rows, cut to the range of their fields."""
        samples = np.empty(len(counts), self.profile.sample)
        for name, column in self.columns.items():
            bounds = np.iinfo(self.profile.sample[name])
            samples[name] = np.clip(counts[:, column], bounds.min, bounds.max)
        return samples

    def saturated(self, counts: NDArray[np.int32]) -> NDArray[np.bool_]:
        """Return in which rows any converter is at its limit."""
        found = np.zeros(len(counts), np.bool_)
        for column, (low, high) in self.converted.items():
            found |= (counts[:, column] <= low) | (counts[:, column] >= high)
        return found
