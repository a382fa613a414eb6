"""The answer to a case: what is hidden, its own columns, and the best possible error.

A column is what the effect adds to an equation's target, worked out on what the plant did. Fitted
with the declared terms it gives the residual of a perfect answer: the oracle's error.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.rigs import residual
from benchmarks.rigs.hidden import MOST, Hidden
from benchmarks.rigs.residual import EQUATIONS, Fitted, Prepared
from benchmarks.rigs.stage import FIRST, RATE_HZ, Stage, Switched, signature
from estimation.filters import zero_phase
from estimation.recording import FloatArray

Columns = Mapping[str, tuple[FloatArray, ...]]
"""Equation to its true columns, one array (n, effects) a run, filtered, at every sample."""


@dataclass(frozen=True, eq=False)
class HiddenTruth:
    """One hidden effect of a case.

    Attributes:
        place: Part of the machine: motor shaft, gear, spindle, cable, jaw, pulley, or a sensor.
        family: What it should be called; `unknown` outside the catalogue.
        variables: What it depends on.
        strength: Residual of the declared equation that shows it best, root mean square over those
            runs, with this effect over that without any.
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
    columns: Columns
    together: tuple[str, ...] = ()

    @property
    def families(self) -> tuple[tuple[str, ...], ...]:
        """Families that count as right, one tuple an effect; in a confounded case the whole set."""
        if self.together:
            return (self.together,)
        return tuple(tuple(dict.fromkeys((e.family, *e.synonyms))) for e in self.effects)


def columns(
    stage: Stage, effects: Sequence[Switched], clean: Mapping[str, Fitted]
) -> dict[str, tuple[FloatArray, ...]]:
    """Return each equation's true columns, all effects on: filtered, (n, effects) a run."""
    found: dict[str, list[FloatArray]] = {equation: [] for equation in EQUATIONS}
    low_pass = residual.declared("motor").low_pass
    for index in stage.every:
        n = len(stage.plans[index].setpoints) - FIRST
        tables = {equation: np.zeros((n, len(effects))) for equation in EQUATIONS}
        moved = stage.moved(index, effects)
        there = [e for e in effects if index in e.runs and isinstance(e.drawn.part, Hidden)]
        for k, effect in enumerate(effects):
            if index not in effect.runs:
                continue
            if isinstance(effect.drawn.part, Hidden):
                row = there.index(effect)
                for equation, weight in signature(effect.drawn.part.place, stage.plant).items():
                    tables[equation][:, k] = weight * moved.added[FIRST:, row]
                if effect.drawn.part.place == "pulley":
                    tables["cable"][:, k] = moved.added[FIRST:, MOST + row]
                for equation in EQUATIONS:
                    column = tables[equation][:, k]
                    tables[equation][:, k] = zero_phase(column, RATE_HZ, low_pass)
            else:
                for equation, values in _shown_by_fault(stage, index, effects, k, clean).items():
                    tables[equation][:, k] = values
        for equation in EQUATIONS:
            found[equation].append(tables[equation])
    return {equation: tuple(tables) for equation, tables in found.items()}


def _shown_by_fault(
    stage: Stage, index: int, effects: Sequence[Switched], k: int, clean: Mapping[str, Fitted]
) -> dict[str, FloatArray]:
    """Return every equation in one run with one faulty sensor, the plant moved alike."""
    sound = [e for j, e in enumerate(effects) if j != k]
    both = [
        residual.prepare(stage.record(index, chosen, silent=True), stage.plant.ratio)
        for chosen in (effects, sound)
    ]
    found = {}
    for equation in EQUATIONS:
        broken, whole = residual.left_with(both, clean[equation])
        found[equation] = broken - whole
    return found


def oracle(
    runs: Sequence[Prepared], added: Columns, declared: Mapping[str, Fitted]
) -> dict[str, Fitted]:
    """Fit the equations with the true columns; where there are none, the declared fits stand."""
    found = {}
    for equation in EQUATIONS:
        there = any(np.any(a) for a in added[equation])
        extra = added[equation]
        found[equation] = residual.fit(runs, equation, extra) if there else declared[equation]
    return found
