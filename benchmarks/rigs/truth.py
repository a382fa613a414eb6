"""The answer to a simulated case."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from estimation.recording import FloatArray


@dataclass(frozen=True, eq=False)
class HiddenTruth:
    """One hidden effect of a case."""

    place: str  # Part of the machine: motor shaft, gear, spindle, cable, jaw, pulley, or a sensor
    family: str  # What it should be called; `unknown` outside the catalogue
    variables: tuple[str, ...]  # What it depends on
    runs: tuple[int, ...]  # Places of the runs that have it
    # Residual of the declared equation that shows it best, root mean square over those runs, with
    # this effect over that without any
    strength: float
    equation: str  # That equation
    recipe: str  # What it was drawn by, for people
    amplitude: float  # Its amplitude, in the unit of its place
    synonyms: tuple[str, ...] = ()  # Families that name the same physics by another model of it


@dataclass(frozen=True, eq=False)
class Truth:
    """What is hidden in a case, and the residual of a perfect answer."""

    effects: tuple[HiddenTruth, ...]  # The hidden effects; none in a clean case
    # Equation to the residual of its declared structure without any effect, root mean square over
    # all runs, in the unit of its target
    clean_rms: Mapping[str, float]
    with_rms: Mapping[str, float]  # The same with the effects
    # The same with the effects, the true structure fitted with the declared one
    oracle_rms: Mapping[str, float]
    # Equation to the true structure's own columns, one array (n, effects) a run, in the target's
    # unit, filtered as the equation's channels are, at every sample
    columns: Mapping[str, tuple[FloatArray, ...]]
    # In a confounded case: the families that reproduce the effect to within noise on these runs,
    # the true one among them; else empty
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
