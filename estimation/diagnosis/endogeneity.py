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
from estimation.diagnosis.instruments import (
    ACCELERATION,
    ANGLE,
    FORCES,
    SPEED,
    Fit,
    as_told,
    fitted,
    instrument_columns,
)
from estimation.diagnosis.least_squares import beyond, least_squares, orthonormal
from estimation.effects.effect import Pointwise
from estimation.recording import FloatArray

STRETCH = 50
"""Samples over which the noise of a force is told from its course: half a second at 100 Hz."""

BEND = 2
"""Degree of that course: what a motion does in half a second."""

PULL = 1e-8
"""On columns of length 1: settles those that the others hold."""

TINY = float(np.finfo(float).tiny)


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
    own_columns = beyond(seen[:, :-count], seen[:, -count:])
    size, left = own_columns @ plain, own_columns @ through
    return float(size @ left / max(float(size @ size), np.finfo(float).tiny))


def noise_share(
    balance: Balance, terms: Sequence[Candidate], added: Sequence[FloatArray], every: int = 1
) -> float:
    """Return the share of the squared error that columns remove which is a force sensor's noise.

    Where every run meets the same load at the same place, that place tells the force without the
    noise of its sensor: the gain that the model has on the sensor then shrinks, and its noise goes,
    which nothing missing could do. Below 0 where the gain grows.

    Args:
        balance: The balance.
        terms: Declared effects and those found before.
        added: Columns of each run.
        every: Only every so manieth sample, where `added` has no others.
    """
    forces = forces_read(terms)
    read = np.array([force is not None for force in forces])
    if not read.any():
        return 0.0
    columns = balance.columns(terms)
    aim = np.concatenate([y[::every] for y in balance.target])
    own = np.vstack([c[::every] for c in columns])
    whole = np.hstack([own, np.vstack(list(added)), aim[:, None]])
    whole /= np.maximum(np.linalg.norm(whole, axis=0), np.finfo(float).tiny)
    gram = whole.T @ whole
    count = len(read)
    alone, left = _solved(gram[:count, :count], gram[:count, -1])
    beside, less = _solved(gram[:-1, :-1], gram[:-1, -1])
    power = np.einsum("nk,nk->k", own, own)[read]
    noise = np.array(
        [
            _noise_power(balance.runs, [c[:, k] for c in columns], force)
            for k, force in enumerate(forces)
            if force is not None
        ]
    )
    gains = (alone[read] ** 2 - beside[:count][read] ** 2) / np.maximum(power, TINY)
    return len(aim) * float(gains @ noise) / max(left - less, TINY)


def bends_force(terms: Sequence[Candidate], added: Sequence[Candidate]) -> bool:
    """Say whether an effect is a function of a force that declared terms read, sample by sample.

    It then has the noise of that reading as well: what the declared gain loses of it, it has.
    """
    read = {*forces_read(terms)}
    return any(
        isinstance(c.effect, Pointwise)
        and any(read & {name, *measured_channels([name])} for _, name in c.channels)
        for c in added
    )


def forces_read(terms: Sequence[Candidate]) -> list[str | None]:
    """Return of each column of effects the force whose reading it is made of, or None."""
    forces = [next((c for _, c in term.channels if c in FORCES), None) for term in terms]
    sizes = [len(term.effect.amplitudes) for term in terms]
    return [force for force, size in zip(forces, sizes, strict=True) for _ in range(size)]


def own_share(balance: Balance) -> float:
    """Return the least share of a force's declared column that the other declared ones do not say.

    At one speed either way, friction and a force that stands for it say the same: the gain on the
    force can then hardly be told.
    """
    base = np.vstack(balance.base(balance.terms))
    shares = [1.0]
    for k, force in enumerate(forces_read(balance.terms)):
        if force is None:
            continue
        own = beyond(np.delete(base, k, axis=1), base[:, [k]])
        shares.append(float(np.sum(own**2) / max(np.sum(base[:, k] ** 2), TINY)))
    return min(shares)


def _solved(gram: FloatArray, right: FloatArray) -> tuple[FloatArray, float]:
    """Solve for the weights of columns of length 1; return them and what they leave of the aim."""
    weights = np.asarray(np.linalg.solve(gram + PULL * np.eye(len(gram)), right), np.float64)
    return weights, float(1.0 + weights @ (gram @ weights - 2.0 * right))


def _noise_power(runs: Sequence[Run], column: Sequence[FloatArray], force: str) -> float:
    """Return the power of the noise in a column made of a force, white and slow.

    It is what motion and the other forces do not tell of the column in a stretch where that goes
    its way smoothly: the median stretch, since a few sharp turns are no noise. 0 where the motion
    of the motor is not measured: nothing then says what is noise.
    """
    there = set.intersection(*({*run.channels} for run in runs))
    if not {SPEED, ACCELERATION, ANGLE} <= there:
        return 0.0
    others = [f for f in FORCES if f in there and f != force]
    told = [run.centred(instrument_columns(run.channels, others)) for run in runs]
    weights = least_squares(np.vstack(told), np.concatenate(column))
    left = [values - table @ weights for values, table in zip(column, told, strict=True)]
    cut = [values[: len(values) // STRETCH * STRETCH].reshape(-1, STRETCH) for values in left]
    course, _ = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, STRETCH), BEND + 1))
    stretches = np.vstack(cut)
    rough = stretches - stretches @ course @ course.T
    powers = np.sum(rough**2, axis=1) / (STRETCH - BEND - 1)
    return float(np.median(powers)) if len(powers) else 0.0


def _noisy(terms: Iterable[Candidate]) -> set[str]:
    """Return the channels of effects that are made of a torque or of the current."""
    channels = {name for term in terms for _, name in term.channels}
    return {name for name in channels if {name, *measured_channels([name])} & set(FORCES)}


def _told(run: Run, fits: dict[str, Fit]) -> Run:
    """Return the run with its noisy channels as the other sensors tell them."""
    told = {name: as_told(run, fit) for name, fit in fits.items()}
    return replace(run, channels={**run.channels, **told})
