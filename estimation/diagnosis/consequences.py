"""What a cause found in one balance makes of another one, whose residual has another unit.

A sensor's fault enters every balance that reads it, and what shakes the axis moves everything that
the declared model left out because it hardly moved. Through the rig's own dynamics that is, to a
low order, the cause's contribution, its rates and its bends: where these remove from the second
balance most of what its own finding removes, the second finding is no second cause.
"""

import numpy as np

from estimation.diagnosis.design import Run
from estimation.diagnosis.frozen import Part
from estimation.diagnosis.least_squares import least_squares
from estimation.diagnosis.story import Story
from estimation.recording import FloatArray

MOST = 0.7
"""Share of what the second finding removes that the first one's consequences must remove."""


def follows(cause: Story, first: int, story: Story, second: int) -> bool:
    """Say whether a claim is a consequence of a claim of another balance.

    Args:
        cause: The story of the balance of the cause.
        first: Place of its claim there.
        story: The story of the other balance.
        second: Place of the claim there that may be its consequence.
    """
    origin = {run.name: run for run in cause.balance.runs}
    balance = story.balance
    others = [t for k, c in enumerate(story.claims) if k != second for t in c.part.terms]
    base = balance.base([*balance.terms, *others])
    rows: list[list[FloatArray]] = []
    for k, run in enumerate(balance.runs):
        if run.name not in origin:
            continue
        echo = run.thin(_echo(cause.claims[first].part, origin[run.name]))
        own = run.thin(_columns(story.claims[second].part, run))
        parts = (base[k], echo, own, balance.target[k])
        rows.append([part - part.mean(axis=0) for part in parts])
    if not rows:
        return False
    known, echoes, named, aim = (np.concatenate(part) for part in zip(*rows, strict=True))
    left = [_left(np.hstack([known, *more]), aim) for more in ([], [echoes], [named])]
    return left[0] - left[1] >= MOST * (left[0] - left[2])


def _echo(part: Part, run: Run) -> FloatArray:
    """Return what a claim adds, its bends and its rates, shape (samples of the run, 5 k)."""
    columns = _columns(part, run)
    columns = columns / np.maximum(np.abs(columns).max(axis=0), np.finfo(float).tiny)
    rate = np.gradient(columns, run.channels["time_s"], axis=0)
    again = np.gradient(rate, run.channels["time_s"], axis=0)
    return np.hstack([columns, columns * np.abs(columns), columns**3, rate, again])


def _columns(part: Part, run: Run) -> FloatArray:
    """Return the columns of what a claim adds, shape (samples of the run, k)."""
    blocks = [term.columns(run.channels) for term in part.terms]
    if part.map is not None:
        blocks.append(part.map.columns(run))
    return np.hstack(blocks)


def _left(columns: FloatArray, aim: FloatArray) -> float:
    """Return the squared error that a fit of columns leaves."""
    return float(np.sum((aim - columns @ least_squares(columns, aim)) ** 2))
