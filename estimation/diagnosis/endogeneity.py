"""Whether an effect hangs on the noise of a regressor.

A least-squares fit takes the noise of a regressor for a weaker dependence, and an effect that goes
along with the regressor then fills the gap: slow noise in a torque sensor looks like a loop. Fitted
through instruments, which that noise is not in, an effect that is there keeps its size, and one
that is not loses it (the comparison of Durbin 1954, Wu 1973 and Hausman 1978).
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from estimation.derived import measured_channels
from estimation.diagnosis.balance import Balance
from estimation.diagnosis.candidate import Candidate
from estimation.diagnosis.design import Run
from estimation.diagnosis.instruments import FORCES, Fit, as_told, fitted, instrument_columns
from estimation.diagnosis.least_squares import least_squares, orthonormal
from estimation.recording import FloatArray


def kept_share(
    balance: Balance, terms: Sequence[Candidate], added: Sequence[Candidate]
) -> float | None:
    """Return how much of what an effect adds is left when it is fitted through instruments.

    About 1 for an effect that is there; about 0 for one made of a regressor's noise. None when no
    torque or current is a regressor, or no other sensor tells of it.

    Args:
        balance: The balance.
        terms: Declared effects and those found before.
        added: The effect, or the two of a pair.
    """
    noisy = _noisy([*terms, *added])
    fits = {n: fit for n in noisy if (fit := fitted(balance.runs, n, balance.model.target))}
    if not fits:
        return None
    own = {balance.model.target, *measured_channels([balance.model.target])}
    own |= {source for name in noisy for source in measured_channels([name])}
    forces = [f for f in FORCES if f not in own and all(f in run.channels for run in balance.runs)]
    together = [*terms, *added]
    seen = np.vstack(balance.columns(together))
    told = replace(balance, runs=[_told(r, fits) for r in balance.runs], tables_of={})
    outside = [instrument_columns(r.channels, forces)[r.kept] for r in balance.runs]
    outside = [block - block.mean(axis=0) for block in outside]
    basis = orthonormal(np.hstack([np.vstack(told.columns(together)), np.vstack(outside)]))
    aim = np.concatenate(balance.target)
    count = sum(len(c.effect.amplitudes) for c in added)
    plain = least_squares(seen, aim)[-count:]
    through = least_squares(basis @ (basis.T @ seen), aim)[-count:]
    own_columns = _beside(seen[:, :-count], seen[:, -count:])
    size, left = own_columns @ plain, own_columns @ through
    return float(size @ left / max(float(size @ size), np.finfo(float).tiny))


def _noisy(terms: Iterable[Candidate]) -> set[str]:
    """Return the channels of effects that are made of a torque or of the current."""
    channels = {name for term in terms for _, name in term.channels}
    return {name for name in channels if {name, *measured_channels([name])} & set(FORCES)}


def _told(run: Run, fits: dict[str, Fit]) -> Run:
    """Return the run with its noisy channels as the other sensors tell them."""
    told = {name: as_told(run, fit) for name, fit in fits.items()}
    return replace(run, channels={**run.channels, **told})


def _beside(base: FloatArray, columns: FloatArray) -> FloatArray:
    """Return what columns have that others do not."""
    if not base.shape[1]:
        return columns
    return np.asarray(columns - base @ np.linalg.lstsq(base, columns, rcond=1e-10)[0])
