"""A hidden effect of the simulated plant as data, and its arrays for the compiled loop.

An effect adds `amplitude x operator(one variable) x table(another)` at one place of the plant. The
operator is a table, or has memory: stops side by side, relays side by side, a Bouc-Wen loop, lags.
So its form is drawn, not written: no two cases share a formula.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimation.recording import FloatArray
from rig.simulation.forms import BANK


class Variable(IntEnum):
    """What an effect's tables may be over, as places in the compiled loop's array.

    `*_WAY` is the size of a speed; `JUMP` switches between 0 and 1 at random times; `DWELL` is 1
    after a long rest and falls as it slides; `HEAT` is the square of the current behind a lag.
    """

    ONE = 0
    MOTOR_ANGLE = 1
    MOTOR_SPEED = 2
    SPINDLE_ANGLE = 3
    SPINDLE_SPEED = 4
    JAW_ANGLE = 5
    JAW_SPEED = 6
    CURRENT = 7
    GEAR_TORQUE = 8
    CABLE_TORQUE = 9
    RUN_TIME = 10
    CAMPAIGN_TIME = 11
    ACCELERATION = 12
    DWELL = 13
    HEAT = 14
    JUMP = 15
    TWIST = 16
    STRETCH = 17
    MOTOR_WAY = 18
    SPINDLE_WAY = 19


class Place(IntEnum):
    """Where an effect acts.

    A torque against the motor, a share of the torque constant lost, twist of the gear beyond its
    spring's, a torque against the spindle, elongation of the cable beyond its spring's, a torque
    against the jaw in front of its sensor, cable wound beyond a round pulley's.
    """

    MOTOR = 0
    CONSTANT = 1
    GEAR = 2
    SPINDLE = 3
    CABLE = 4
    JAW = 5
    PULLEY = 6


class Operator(IntEnum):
    """What is done to an effect's first variable; all but a table have memory."""

    TABLE = 0
    STOPS = 1
    RELAYS = 2
    BOUC_WEN = 3
    LAGS = 4


MOST = 2  # Most effects at once
TABLE_POINTS = 2048


@dataclass(frozen=True, eq=False)
class Table:
    """A function of one variable."""

    variable: str  # Name of the variable
    low: float  # First point of the grid
    high: float  # Last point
    values: FloatArray  # Shape (`POINTS`,)
    # Whether it repeats itself beyond the range; its last value is then its first
    periodic: bool = False

    @property
    def x(self) -> FloatArray:
        """The grid, shape (`POINTS`,)."""
        return np.linspace(self.low, self.high, len(self.values))

    def at(self, x: FloatArray) -> FloatArray:
        """Return its values at places, the same shape."""
        place = np.mod(x - self.low, self.high - self.low) + self.low if self.periodic else x
        found: FloatArray = np.interp(place, self.x, self.values)
        return found

    def steepest(self) -> float:
        """Return its largest slope, without sign."""
        return float(np.max(np.abs(np.gradient(self.values, self.x))))


@dataclass(frozen=True, eq=False)
class Hidden:
    """One hidden effect of the plant.

    Attributes:
        place: Name of a `Place`, in small letters.
        operator: Name of an `Operator`.
        tables: Up to two factors; the first is the operator's variable where that has memory.
        friction: Whether it is a level of friction, which takes the sign of its place's speed.
        similar: Whether the table's width grows with the amplitude, as play's does.
        reach: Of stops: how far each moves. Of relays: where each switches on, then off. Of lags:
            time of each, s. Of Bouc-Wen: its reach, sharpness and share that loads.
        weights: Of each element.
        dwell_s: Time within which a rest counts, and slip, rad, that wears it off.
        heat_s: Lag of the heat.
    """

    place: str
    operator: str
    tables: tuple[Table, ...]
    friction: bool = False
    similar: bool = False
    reach: FloatArray = field(default_factory=lambda: np.empty(0))
    weights: FloatArray = field(default_factory=lambda: np.empty(0))
    dwell_s: tuple[float, float] = (1.0, 1.0)
    heat_s: float = 5.0


class Rows(NamedTuple):
    """Effects as the compiled loop takes them."""

    number: int
    kinds: NDArray[np.int64]  # (effects, 8): place, operator, friction, similar, 2 variables, bank
    amplitudes: FloatArray  # (effects,)
    ranges: FloatArray  # (effects, 2, 3): low, high, periodic
    tables: FloatArray  # (effects, 2, TABLE_POINTS)
    reach: FloatArray  # (effects, 2 BANK)
    weights: FloatArray  # (effects, BANK)
    times: FloatArray  # (3,): dwell's time and slip, heat's lag


def rows_of(effects: Sequence[Hidden], amplitudes: Sequence[float]) -> Rows:
    """Return effects with their amplitudes as the compiled loop takes them."""
    rows = Rows(
        len(effects),
        np.zeros((MOST, 8), np.int64),
        np.zeros(MOST),
        np.zeros((MOST, 2, 3)),
        np.ones((MOST, 2, TABLE_POINTS)),
        np.ones((MOST, 2 * BANK)),
        np.zeros((MOST, BANK)),
        np.array([1.0, 1.0, 5.0]),
    )
    for k, (effect, amplitude) in enumerate(zip(effects, amplitudes, strict=True)):
        names = [t.variable for t in effect.tables] + ["one"] * (2 - len(effect.tables))
        rows.kinds[k, :4] = (
            Place[effect.place.upper()],
            Operator[effect.operator.upper()],
            effect.friction,
            effect.similar,
        )
        rows.kinds[k, 4:6] = [Variable[name.upper()] for name in names]
        rows.kinds[k, 6] = len(effect.weights)
        rows.amplitudes[k] = amplitude
        for j, table in enumerate(effect.tables):
            rows.ranges[k, j] = table.low, table.high, table.periodic
            fine = np.linspace(table.low, table.high, TABLE_POINTS)
            rows.tables[k, j] = np.interp(fine, table.x, table.values)
        rows.reach[k, : len(effect.reach)] = effect.reach
        rows.weights[k, : len(effect.weights)] = effect.weights
        if "dwell" in names:
            rows.times[:2] = effect.dwell_s
        if "heat" in names:
            rows.times[2] = effect.heat_s
    return rows
