"""What a hidden effect is in the declared equations: its own columns, and the best possible error.

A column is what the effect adds to an equation's target, worked out on what the plant did. Fitted
with the declared terms it gives the residual of a perfect answer: the oracle's error.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from benchmarks.rigs import residual
from benchmarks.rigs.hidden import MOST, Hidden
from benchmarks.rigs.residual import EQUATIONS, Fitted, Prepared
from benchmarks.rigs.stage import FIRST, RATE_HZ, Stage, Switched, signature
from estimation.filters import zero_phase
from estimation.recording import FloatArray

Columns = Mapping[str, tuple[FloatArray, ...]]
"""Equation to its true columns, one array (n, effects) a run, filtered, at every sample."""


def columns(
    stage: Stage, effects: Sequence[Switched], clean: Mapping[str, Fitted]
) -> dict[str, tuple[FloatArray, ...]]:
    """Return each equation's true columns, one array (n, effects) a run, filtered.

    Args:
        stage: The rig.
        effects: The effects, all on.
        clean: The declared equations fitted without them.
    """
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
    """Fit the equations with the true columns and the declared ones.

    Args:
        runs: The runs.
        added: From `columns`.
        declared: Fits of the declared columns alone, which stand where there are no others.
    """
    found = {}
    for equation in EQUATIONS:
        there = any(np.any(a) for a in added[equation])
        extra = added[equation]
        found[equation] = residual.fit(runs, equation, extra) if there else declared[equation]
    return found
