"""What a physical effect is: equation, inputs, parameters, offline columns and live step.

An effect adds `sum amplitude_i * column_i` to one side of a balance. It is linear in its
amplitudes; parameters inside the columns (a width, a time constant) are its shape. Inputs are named
by their role (`speed`, `load`), so that the same effect serves the motor, the jaw or an arm joint;
a model says which channel plays which role and on which side of the balance the effect stands.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from estimation.recording import FloatArray


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter of an effect.

    Attributes:
        name: Name, unique in the effect.
        unit: Unit expression over `target` and the effect's roles, such as `target / speed`.
        description: What it means.
        lower: Smallest value that makes physical sense, in SI units.
        upper: Largest value that makes physical sense.
        linear: Of a shape parameter: it is searched on a linear scale and may be zero or negative,
            such as a position; else on a logarithmic one.
        points: Of a shape parameter: how many values between its bounds a search tries before it
            refines the best. An order needs many: between two of them lies a narrow peak.
    """

    name: str
    unit: str
    description: str
    lower: float = -np.inf
    upper: float = np.inf
    linear: bool = False
    points: int = 13

    def grid(self) -> FloatArray:
        """Return the values a search tries first, shape (points,), from `lower` to `upper`."""
        if self.linear:
            return np.linspace(self.lower, self.upper, self.points)
        return np.geomspace(self.lower, self.upper, self.points)


class Effect(ABC):
    """One physical effect. A subclass in a file of this package joins the catalogue by being there.

    Its docstring states the equation and the source. Class attributes:

    Attributes:
        id: Name of the effect, unique in the catalogue, such as `friction.coulomb`.
        family: What a diagnosis calls it; the id unless stated. Several forms of one cause share a
            family, and the id of a form is its family with one more word
            (`hysteresis.presliding.lugre`).
        balances: Balances a search may add it to, and the side it stands on there: 1 adds to the
            target, -1 takes from it, so that a bound on an amplitude means the same everywhere.
            `joint` stands for every `joint.N`. Empty for what is only ever declared, such as the
            torque constant. Which channel plays a role in which balance is told by
            `estimation.effects.roles`.
        roles: Role of each input, and the channel that plays it unless a model says otherwise.
        amplitudes: Linear parameters, one a column.
        shape: Non-linear parameters, searched between their bounds; positive unless `linear`.
        projected_roles: Roles a search takes as the other sensors tell them, not as measured: those
            whose noise the columns could take out of a residual. A model that runs reads them.
        confused_with: Ids of effects that look alike when the excitation is poor.
        told_apart_by: The experiment that tells them apart.
        same_as: Families that only that experiment tells from it: where both read the same
            channels, each is named with the other beside it.
        other_below: Shape parameters at whose lower bound it turns into another effect.
        bends: Roles along which another form than the equation's may be the true one: names are
            compared with forms that bend there.
        any_function_of: Variables of which any function, whatever its form, is this effect: a map
            of them is no other name.
        at_rest: Whether it says what acts at rest: a search tries it where samples at rest count.
    """

    id: ClassVar[str]
    family: ClassVar[str]
    balances: ClassVar[Mapping[str, int]] = {}
    roles: ClassVar[Mapping[str, str]]
    amplitudes: ClassVar[tuple[Parameter, ...]]
    shape: ClassVar[tuple[Parameter, ...]] = ()
    projected_roles: ClassVar[tuple[str, ...]] = ()
    confused_with: ClassVar[tuple[str, ...]] = ()
    told_apart_by: ClassVar[str] = ""
    same_as: ClassVar[tuple[str, ...]] = ()
    at_rest: ClassVar[bool] = False
    other_below: ClassVar[tuple[str, ...]] = ()
    bends: ClassVar[tuple[str, ...]] = ()
    any_function_of: ClassVar[tuple[str, ...]] = ()

    def __init_subclass__(cls) -> None:
        """Let the family be the id where none is stated."""
        if "id" in vars(cls) and "family" not in vars(cls):
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
        """Return one row of the columns for one live sample, the same to rounding.

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
    def row(self, inputs: Mapping[str, Any], shape: Sequence[float]) -> Sequence[Any]:
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
    """An effect with memory: each row of its columns depends on what came before in its run.

    One compiled function walks over the samples of a run, and over a single one live. A state
    that moves with time has the role `clock` among its roles, so that it does not depend on the
    rate of the samples; what it forgets with time counts from the first sample it was given.
    A sample with an input that is not finite gives NaN and leaves the state as it was.

    Attributes:
        walk: The compiled function; the columns of its first argument are the roles in order.
        rest: State before the first sample. The first value of most is 0 until a sample has come.
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
