"""Effects in a form that may bend: to compare what they depend on, not how they are written.

An equation of the catalogue is one form of a cause; that of the rig at hand may be flatter or
steeper. Of two effects that depend on different variables the one with the luckier form may remove
more, so they are compared with every form that is a little bent.
"""

from collections.abc import Sequence

import numpy as np

from estimation.diagnosis.balance import Balance
from estimation.diagnosis.candidate import Candidate
from estimation.diagnosis.evidence import Losses, leave_one_run_out
from estimation.recording import FloatArray

RIDGE = 1e-5
POWERS = (1, 2)


def bent_losses(
    balance: Balance,
    base: Sequence[FloatArray],
    candidate: Candidate,
    left: Sequence[FloatArray],
) -> Losses:
    """Return the losses of runs left out of an effect whose form may bend.

    Args:
        balance: The balance.
        base: What is refitted beside it, from `Balance.base`.
        candidate: The effect.
        left: What the base leaves of each run, shape (n,).
    """
    columns = _columns(balance, candidate)
    aims = [r[:, None] for r in left]
    return leave_one_run_out(base, columns, [columns[0].shape[1]], aims, RIDGE)


def _columns(balance: Balance, candidate: Candidate) -> list[FloatArray]:
    """Return an effect's columns, and they times powers of the inputs it may bend along."""
    bends = [name for role, name in candidate.channels if role in candidate.effect.bends]
    if not bends:
        return balance.columns([candidate])
    sizes = {name: _size(balance, name) for name in bends}
    columns = []
    for run in balance.runs:
        own = candidate.columns(run.channels)
        factors = [np.abs(run.channels[name]) / sizes[name] for name in bends]
        parts = [own, *(own * (f**p)[:, None] for f in factors for p in POWERS)]
        whole = np.hstack(parts)
        columns.append(run.centred(whole) if balance.demean else run.thin(whole))
    return columns


def _size(balance: Balance, name: str) -> float:
    """Return how large a channel usually gets."""
    values = np.concatenate([run.sampled[name] for run in balance.runs])
    return float(max(np.percentile(np.abs(values), 99), np.finfo(float).tiny))
