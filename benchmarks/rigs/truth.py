"""The answer to a simulated case."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from estimation.recording import FloatArray


@dataclass(frozen=True, eq=False)
class HiddenTruth:
    """One hidden effect of a case.

    Attributes:
        place: Part of the machine: motor shaft, gear, spindle, cable, jaw, pulley, or a sensor.
        family: What it should be called; `unknown` outside the catalogue.
        variables: What it depends on.
        runs: Places of the runs that have it.
        strength: Residual of the declared equation that shows it best, root mean square over those
            runs, with this effect over that without any.
        equation: That equation.
        recipe: What it was drawn by, for people.
        amplitude: Its amplitude, in the unit of its place.
        synonyms: Families that name the same physics by another model of it.
    """

    place: str
    family: str
    variables: tuple[str, ...]
    runs: tuple[int, ...]
    strength: float
    equation: str
    recipe: str
    amplitude: float
    synonyms: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Truth:
    """What is hidden in a case, and the residual of a perfect answer.

    Attributes:
        effects: The hidden effects; none in a clean case.
        clean_rms: Equation to the residual of its declared structure without any effect, root mean
            square over all runs, in the unit of its target.
        with_rms: The same with the effects.
        oracle_rms: The same with the effects, the true structure fitted with the declared one.
        columns: Equation to the true structure's own columns, one array (n, effects) a run, in the
            target's unit, filtered as the equation's channels are, at every sample.
        together: In a confounded case: the families that reproduce the effect to within noise on
            these runs, the true one among them; else empty.
    """

    effects: tuple[HiddenTruth, ...]
    clean_rms: Mapping[str, float]
    with_rms: Mapping[str, float]
    oracle_rms: Mapping[str, float]
    columns: Mapping[str, tuple[FloatArray, ...]]
    together: tuple[str, ...] = ()

    @property
    def families(self) -> tuple[tuple[str, ...], ...]:
        """Families that count as right, one tuple an effect; in a confounded case the whole set."""
        if self.together:
            return (self.together,)
        return tuple(tuple(dict.fromkeys((e.family, *e.synonyms))) for e in self.effects)

    def shown(self, equation: str) -> bool:
        """Whether an equation's columns hold anything."""
        return any(np.any(c) for c in self.columns[equation])
