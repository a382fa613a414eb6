"""What the plain simulated board does a tick, by profile."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from drivers.teensy.profile import Profile
from drivers.teensy.protocol import STATUS_ARMED

STATE, ENGAGED = range(2)
"""Places in a drive's state, int64: the board's status, and whether a setpoint has come."""


@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """All that a tick of the plain board needs and changes, besides its inputs.

    Attributes:
        state: See the places above; changed in place.
        control_state: State of each controller, shape (motors, 4); changed in place.
        gains: Gains of each controller, shape (motors, 5).
    """

    state: NDArray[np.int64]
    control_state: NDArray[np.float64]
    gains: NDArray[np.float64]

    @classmethod
    def armed(cls, gains: Any, engaged: bool = True) -> "Drive":
        """Return a drive just armed, gains (5,) or (motors, 5); engaged by a setpoint or not."""
        rows = np.atleast_2d(np.array(gains, np.float64))
        return cls(np.array((STATUS_ARMED, engaged), np.int64), np.zeros((len(rows), 4)), rows)

    @classmethod
    def idle(cls, motors: int = 1) -> "Drive":
        """Return a drive that was never armed."""
        drive = cls.armed(np.zeros((motors, 5)), engaged=False)
        drive.state[STATE] = 0
        return drive

    @property
    def arrays(self) -> tuple[NDArray[Any], ...]:
        """Return state, controllers and gains, as a profile's tick takes them."""
        return self.state, self.control_state, self.gains


@dataclass(frozen=True, eq=False)
class BoardLogic:
    """One profile's logic.

    Attributes:
        profile: The profile.
        columns: Field of a sample to the column of a tick's row.
        status_column: Column of the board's state.
        converted: Column of each converter to the counts from which down and up it is saturated.
    """

    profile: Profile
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


class Bench(Protocol):
    """The physics behind a board, in ticks of its profile."""

    @property
    def advance(self) -> Callable[..., NDArray[np.int32]]:
        """Run closed-loop ticks and return the counts, a row a tick, int32.

        Within a tick: the inputs are sampled into a row, the profile's tick
        (`drivers.teensy.reference_board.drive_tick`, `drivers.teensy.grasper_board.grasper_tick`)
        writes what the motors get behind them, the physics moves a tick. The result does not depend
        on how ticks are divided between calls.

        Args:
            ticks: Number of ticks.
            plan: A setpoint's fields, one array of shape (ticks,) each, int32; then the board's
                `Drive`, changed in place.
        """
