"""The interface of a physical effect: equation, inputs, parameters, offline columns and live step.

An effect adds `sum amplitude_i * column_i` to one side of an equation. It is linear in its
amplitudes; parameters inside the columns (a width, a time constant) are its shape. Inputs are named
by their role (`speed`, `load`), so that the same effect serves the motor, the jaw or an arm joint.
A model assigns a channel to each role and a side of the equation to the effect.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from estimation.recording import FloatArray

Inputs = Mapping[str, Any]
"""Role to one value or to an array of shape (n,)."""
Shape = Sequence[float]
"""Values of the shape parameters, in order."""
Row = Sequence[Any]
"""One value or one array of shape (n,) for each amplitude."""

REFERENCE_K = 298.15
"""Temperature at which data sheets state values, K."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter of an effect.

    Attributes:
        name: Name, unique in the effect.
        unit: Unit expression over `target`, the effect's roles and `rad`, such as `target / speed`.
        description: Meaning in words.
        lower: Smallest physically meaningful value, in SI units.
        upper: Largest physically meaningful value.
        linear: For a shape parameter: True if it is searched on a linear scale and may be zero or
            negative, such as a position; otherwise the scale is logarithmic.
        points: For a shape parameter: number of values between its bounds that a search tries
            before it refines the best one. An order needs many values, as its peaks are narrow.
    """

    name: str
    unit: str
    description: str
    lower: float = -np.inf
    upper: float = np.inf
    linear: bool = False
    points: int = 13

    @property
    def is_count(self) -> bool:
        """Whether it is a whole number, such as of periods: its bounds are values like others."""
        return self.linear and self.points == 1 + self.upper - self.lower

    def grid(self) -> FloatArray:
        """Return the initial values of a search, shape (points,), from `lower` to `upper`."""
        if self.linear:
            return np.linspace(self.lower, self.upper, self.points)
        return np.geomspace(self.lower, self.upper, self.points)


Parameters = tuple[Parameter, ...]
"""Parameters of an effect; a class annotates them so where a form of it has another number."""

LOSS: Mapping[str, int] = {
    "motor": -1,
    "gearbox": -1,
    "cable": 1,
    "stretch": -1,
    "grasp": -1,
    "joint": 1,
}
"""Equations in which friction takes from the motion, with its side in each."""

READING: Mapping[str, int] = dict.fromkeys(LOSS, 1)
"""The same equations, with the side of what a sensor adds to the target it measures."""


class Effect(ABC):
    """One physical effect. The catalogue finds every subclass in a file of this package.

    The docstring of a subclass contains the physics, the equation with units, a check for a
    technician and the source. Class attributes:

    Attributes:
        id: Name of the effect, unique in the catalogue, such as `friction.coulomb`.
        family: Name that a diagnosis reports; the id by default. Several functional forms of one
            physical effect are in one file and share a family. The id of a form is its family with
            one more word (`hysteresis.presliding.lugre`); a subclass of an effect is a form of it.
        meaning: What it is in the words of a finding; the first line of its file by default. A form
            that this line does not describe has its own.
        balances: Equations that a search may add it to, and its side there: 1 adds to the target,
            -1 subtracts from it, so that a bound on an amplitude has the same meaning in all of
            them. `joint` stands for every `joint.N`. Empty for an effect that is only declared,
            such as the torque constant.
        roles: Role of each input, and its default channel.
        amplitudes: Linear parameters, one per column.
        shape: Non-linear parameters, searched between their bounds; positive unless `linear`.
        told_apart_by: The experiment that distinguishes them.
        at_rest: Whether it describes standstill. A search tries it where static samples count.
    """

    id: ClassVar[str]
    family: ClassVar[str]
    meaning: ClassVar[str] = ""
    balances: ClassVar[Mapping[str, int]] = {}
    roles: ClassVar[Mapping[str, str]]
    amplitudes: ClassVar[Parameters]
    shape: ClassVar[Parameters] = ()
    told_apart_by: ClassVar[str] = ""
    at_rest: ClassVar[bool] = False

    def __init_subclass__(cls) -> None:
        """Set the family to the id, unless it is a form of another effect."""
        if "id" in vars(cls) and not hasattr(cls, "family"):
            cls.family = cls.id

    @abstractmethod
    def columns(self, inputs: Mapping[str, FloatArray], shape: Sequence[float]) -> FloatArray:
        """Return the columns of a run.

        Args:
            inputs: Role to values in SI units, each of shape (n,); one run from its start.
            shape: Values of the shape parameters, in order.

        Returns:
            Shape (n, number of amplitudes).
        """

    def start(self) -> list[float]:
        """Return the state before the first sample; empty for an effect without memory."""
        return []

    @abstractmethod
    def step(
        self, inputs: Mapping[str, float], shape: Sequence[float], state: list[float]
    ) -> Sequence[float]:
        """Return one row of the columns for one live sample, equal to `columns` to rounding.

        Args:
            inputs: Role to value in SI units.
            shape: Values of the shape parameters, in order.
            state: From `start`, changed in place.
        """


class Pointwise(Effect):
    """An effect without memory: each row of its columns depends on that sample only.

    A subclass writes `row` once, for arrays and for single numbers.
    """

    @abstractmethod
    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array of shape (n,) for each amplitude."""

    def columns(self, inputs: Mapping[str, FloatArray], shape: Sequence[float]) -> FloatArray:
        """Return the columns, shape (n, number of amplitudes)."""
        return np.column_stack(self.row(inputs, shape))

    def step(
        self, inputs: Mapping[str, float], shape: Sequence[float], state: list[float]
    ) -> Sequence[float]:
        """Return one row of the columns."""
        return [float(value) for value in self.row(inputs, shape)]


Walk = Callable[[FloatArray, FloatArray, FloatArray, FloatArray], None]
"""Compiled: inputs (n, roles), shape (s,), state (m,) changed in place, rows (n, amplitudes)."""


class Remembering(Effect):
    """An effect with memory: each row of its columns depends on the earlier samples of its run.

    One compiled function loops over the samples of a run, or takes a single sample live. A state
    that changes with time uses the role `clock`, so that it does not depend on the sample rate; its
    decay starts at the first sample. A sample with an input that is not finite gives NaN and does
    not change the state.

    Attributes:
        walk: The compiled function; the columns of its first argument are the roles in order.
        rest: State before the first sample. The first value of most is 0 until the first sample.
    """

    walk: ClassVar[Walk]
    rest: ClassVar[tuple[float, ...]]

    def columns(self, inputs: Mapping[str, FloatArray], shape: Sequence[float]) -> FloatArray:
        """Return the columns, shape (n, number of amplitudes)."""
        return self._walked(
            np.column_stack([inputs[role] for role in self.roles]), shape, np.array(self.rest)
        )

    def start(self) -> list[float]:
        """Return the state before the first sample."""
        return list(self.rest)

    def step(
        self, inputs: Mapping[str, float], shape: Sequence[float], state: list[float]
    ) -> Sequence[float]:
        """Return one row of the columns."""
        memory = np.array(state)
        rows = self._walked(np.array([[inputs[role] for role in self.roles]]), shape, memory)
        state[:] = memory.tolist()
        return [float(value) for value in rows[0]]

    def _walked(self, now: FloatArray, shape: Sequence[float], state: FloatArray) -> FloatArray:
        if np.isfinite(now.sum()):
            return self._rows(now, shape, state)
        good = np.isfinite(now).all(axis=1)
        rows = np.full((len(now), len(self.amplitudes)), np.nan)
        rows[good] = self._rows(now[good], shape, state)
        return rows

    def _rows(self, now: FloatArray, shape: Sequence[float], state: FloatArray) -> FloatArray:
        rows = np.empty((len(now), len(self.amplitudes)))
        now = np.ascontiguousarray(now, np.float64)
        type(self).walk(now, np.array(shape, np.float64), state, rows)
        return rows


class Proportional(Effect):
    """An effect whose single column is its single input: amplitude x input."""

    def columns(self, inputs: Mapping[str, FloatArray], shape: Sequence[float]) -> FloatArray:
        """Return the input as the one column, shape (n, 1)."""
        (role,) = self.roles
        return inputs[role][:, None]

    def step(
        self, inputs: Mapping[str, float], shape: Sequence[float], state: list[float]
    ) -> Sequence[float]:
        """Return the input as the one value."""
        (role,) = self.roles
        return (inputs[role],)
