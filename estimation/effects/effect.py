"""What a physical effect is: equation, inputs, parameters, offline columns and live step.

An effect adds `sum amplitude_i * column_i` to one side of a balance. It is linear in its
amplitudes; parameters inside the columns (a width, a time constant) are its shape. Inputs are named
by their role (`speed`, `load`), so that the same effect serves the motor, the jaw or an arm joint;
a model says which channel plays which role and on which side of the balance the effect stands.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

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
    """

    name: str
    unit: str
    description: str
    lower: float = -np.inf
    upper: float = np.inf


class Effect(ABC):
    """One physical effect. A subclass in a file of this package joins the catalogue by being there.

    Its docstring states the equation and the source. Class attributes:

    Attributes:
        id: Name of the effect, and what a diagnosis calls it, such as `friction.coulomb`.
        roles: Role of each input, and the channel that plays it unless a model says otherwise.
        amplitudes: Linear parameters, one a column.
        shape: Non-linear parameters; all of them positive, searched on a logarithmic scale between
            their bounds.
        confused_with: Ids of effects that look alike when the excitation is poor.
        told_apart_by: The experiment that tells them apart.
    """

    id: ClassVar[str]
    roles: ClassVar[Mapping[str, str]]
    amplitudes: ClassVar[tuple[Parameter, ...]]
    shape: ClassVar[tuple[Parameter, ...]] = ()
    confused_with: ClassVar[tuple[str, ...]] = ()
    told_apart_by: ClassVar[str] = ""

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
