"""Shapes that samples in motion hardly tell, told by the samples at rest too.

Names, amplitudes and decisions come from samples in motion, since at rest friction holds any
torque. How wide its smooth sign is hardly shows there, nor where a bend begins at small loads, and
the errors that are reported count all samples. So among the shapes that are as good in motion those
are taken that are best over all.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from estimation.diagnosis.balance import Balance
from estimation.diagnosis.candidate import Candidate
from estimation.diagnosis.design import Run
from estimation.recording import FloatArray

FREE = 1.01
"""A shape is as good in motion when it leaves at most so many times the least squared error."""

REACH = 3.0
"""How far a shape may move, in steps of its grid."""


def turned(balance: Balance, terms: Sequence[Candidate]) -> list[Candidate]:
    """Return the effects with each shape as all samples tell it, but of those with memory.

    Args:
        balance: The balance on the runs that discover.
        terms: The effects.
    """
    best = list(terms)
    places = [_places(run) for run in balance.runs]
    if all(len(at) == len(run.kept) for at, run in zip(places, balance.runs, strict=True)):
        return best
    pairs = list(zip(places, balance.runs, strict=True))
    sampled = [{name: x[at] for name, x in run.channels.items()} for at, run in pairs]
    blocks = [[c.columns(run.channels)[at] for c in best] for at, run in pairs]
    most = FREE * balance.loss(best)
    for i, term in enumerate(terms):
        for k in range(len(term.shape)):
            if not term.effect.start():
                best[i] = _settled(balance, best, (i, k), (blocks, sampled), most)
                for channels, block in zip(sampled, blocks, strict=True):
                    block[i] = best[i].columns(channels)
    return best


def _settled(
    balance: Balance,
    terms: list[Candidate],
    place: tuple[int, int],
    seen: tuple[list[list[FloatArray]], list[dict[str, FloatArray]]],
    most: float,
) -> Candidate:
    """Return one effect at its best value of one shape over all samples."""
    i, k = place
    blocks, sampled = seen  # an effect without memory needs no other samples

    def error(steps: float) -> float:
        moved = terms[i].moved(k, steps)
        trial = [*terms[:i], moved, *terms[i + 1 :]]
        motion = balance.loss(trial)
        weights = balance.solve(trial)
        if moved != terms[i]:
            balance.tables_of.pop(moved, None)  # a point of a search, not to be kept
        total = 0.0
        for channels, block in zip(sampled, blocks, strict=True):
            own = moved.columns(channels)
            left = (
                channels[balance.model.target]
                - np.hstack([*block[:i], own, *block[i + 1 :]]) @ weights
            )
            total += float(np.sum((left - left.mean()) ** 2))
        return total * min(max(motion / most, 1.0), FAR) ** PENALTY

    found = optimize.minimize_scalar(
        error, bounds=(-REACH, REACH), method="bounded", options={"xatol": 0.05}
    )
    return terms[i].moved(k, found.x) if found.fun < error(0.0) else terms[i]


PENALTY, FAR = 100, 1e3
"""Power that makes a shape which costs anything in motion lose; beyond `FAR` all are as bad."""


def _places(run: Run) -> NDArray[np.intp]:
    """Return the places of every `down`-th valid sample, those at rest too."""
    at = np.arange(0, len(run.valid), run.down)
    return at[run.valid[at]]
