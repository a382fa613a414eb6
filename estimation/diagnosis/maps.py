"""Maps without a formula: the residual as a smooth function of one to three variables.

They compete with the catalogue. A map that predicts runs left out clearly better than a named
effect withdraws the name; where nothing in the catalogue fits, the map is the effect, and its
variables are what may be said.
"""

import itertools
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from estimation.diagnosis.balance import Balance
from estimation.diagnosis.candidate import Candidate
from estimation.diagnosis.design import Run
from estimation.diagnosis.endogeneity import forces_read, noise_share
from estimation.diagnosis.evidence import chance, leave_one_run_out, runs_agree, surrogates
from estimation.diagnosis.variables import Basis, bases
from estimation.recording import FloatArray

RIDGE = 1e-3
THIN = 2
"""A map is slow in its variables: every second sample tells the same."""

NOISE_SHARE = 0.1
"""A map is none where this share of what it removes is the noise of a sensor of force."""

MOST_OF_NOISE = 20
"""Where so many of the best are made of noise, there is no map."""

SIMPLER = 0.07
"""A smaller subset is taken when its gain is this near to the best, pooled and in the median."""


@dataclass(frozen=True)
class Map:
    """A map of one or two variables, with the direction of motion or not, and the evidence for it.

    Attributes:
        bases: The variables.
        gain: Share of squared error removed on runs left out.
        median_gain: The same share in the median run.
        losses: Squared error of each run left out, shape (runs,).
        base_losses: The same without the map.
        p: Chance of such a gain from the best of all maps on surrogates.
        agree: Signed-rank p-value over the runs.
    """

    bases: tuple[Basis, ...]
    gain: float
    median_gain: float
    losses: FloatArray
    base_losses: FloatArray
    p: float = 1.0
    agree: float = 1.0

    @property
    def variables(self) -> tuple[str, ...]:
        """Names of the variables."""
        return tuple(basis.variable for basis in self.bases)

    def columns(self, run: Run) -> FloatArray:
        """Return the map's columns on one whole run, shape (n, k)."""
        return _products([basis.columns(run) for basis in self.bases])


def best_map(
    balance: Balance,
    terms: Sequence[Candidate],
    count: int,
    seed: int,
    only: Collection[str] | None = None,
) -> Map | None:
    """Return the smallest map that is about as good as the best one.

    Args:
        balance: The balance.
        terms: Effects that are refitted beside the map.
        count: Number of surrogates.
        seed: Their seed.
        only: Variables to map over; None for all.
    """
    offered = [b for b in bases(balance) if only is None or b.variable in only]
    folds = stretches if balance.one_path else list
    base = folds([b[::THIN] for b in balance.base(terms)])
    left = folds([r[::THIN] for r in balance.left(terms)])
    drawn = surrogates(left, count, seed)
    aims = [np.column_stack([r, s]) for r, s in zip(left, drawn, strict=True)]
    singles = {basis: _thinned(balance, basis) for basis in offered}

    def tried(subset: tuple[Basis, ...]) -> tuple[Map, FloatArray]:
        parts = zip(*(singles[basis] for basis in subset), strict=True)
        columns = [_centred(_products(p), balance.demean) for p in parts]
        losses = leave_one_run_out(base, folds(columns), [columns[0].shape[1]], aims, RIDGE)
        joint, alone = losses.joint[:, 0, 0], losses.base[:, 0]
        ratio = joint / np.maximum(alone, np.finfo(float).tiny)
        gain, median = float(losses.gain[0, 0]), float(1 - np.median(ratio))
        made = Map(subset, gain, median, joint, alone, agree=runs_agree(alone, joint))
        return made, losses.gain[0, 1:]

    subsets = [*((b,) for b in offered), *itertools.combinations(offered, 2)]
    results = [tried(subset) for subset in subsets]
    results += [tried(subset) for subset in _with_direction(results, offered)]
    found = [made for made, _ in results]
    null = np.max([np.full(count, -np.inf), *(gains for _, gains in results)], axis=0)
    if not found or max(m.gain for m in found) <= 0:
        return None
    chosen = _simplest(found)
    for _ in range(MOST_OF_NOISE):
        if not _is_of_noise(balance, terms, chosen):
            break
        found.remove(chosen)
        if max((m.gain for m in found), default=0.0) <= 0:
            return None
        chosen = _simplest(found)
    else:
        return None
    return Map(
        chosen.bases,
        chosen.gain,
        chosen.median_gain,
        chosen.losses,
        chosen.base_losses,
        chance(chosen.gain, null),
        chosen.agree,
    )


def _is_of_noise(balance: Balance, terms: Sequence[Candidate], found: Map) -> bool:
    """Say whether a map tells a force in place of its sensor, without that sensor's noise."""
    if {basis.channel for basis in found.bases} & {*forces_read(terms)}:
        return False  # it reads that sensor, noise and all
    parts = zip(*(_thinned(balance, basis) for basis in found.bases), strict=True)
    columns = [_centred(_products(part), balance.demean) for part in parts]
    return noise_share(balance, terms, columns, THIN) > NOISE_SHARE


def stretches(periods: Sequence[FloatArray]) -> list[FloatArray]:
    """Return as many stretches of a path as there are periods, each cut out of every period.

    On a path that repeats itself two positions tell where on the path one is: a map of them learns
    the residual by heart and knows it in every other period. Where stretches are left out, it has
    to predict what it has not seen.
    """
    longest, count = max(map(len, periods)), len(periods)
    ends = [longest * k // count for k in range(count + 1)]
    return [
        np.concatenate([period[first:last] for period in periods])
        for first, last in itertools.pairwise(ends)
    ]


def _thinned(balance: Balance, basis: Basis) -> list[FloatArray]:
    return [run.thin(basis.columns(run))[::THIN] for run in balance.runs]


def _with_direction(
    results: Sequence[tuple[Map, FloatArray]], offered: Sequence[Basis]
) -> list[tuple[Basis, ...]]:
    """Return the best pair of variables with the direction beside it, where it lacks one."""
    sign = next((basis for basis in offered if basis.variable == "velocity_sign"), None)
    best = max((made for made, _ in results), key=lambda made: made.gain, default=None)
    if sign is None or best is None or len(best.bases) < 2:
        return []
    if {"velocity_sign", "velocity", "history"} & set(best.variables):
        return []
    return [(sign, *best.bases)]


def _products(parts: Sequence[FloatArray]) -> FloatArray:
    """Return the products of one column of each part, shape (n, columns)."""
    whole = parts[0]
    for part in parts[1:]:
        whole = np.asarray((whole[:, :, None] * part[:, None, :]).reshape(len(whole), -1))
    return whole


def _centred(columns: FloatArray, demean: bool) -> FloatArray:
    return columns - columns.mean(axis=0) if demean else columns


def _simplest(found: Sequence[Map]) -> Map:
    """Return the first single variable, else pair, near enough to the best."""
    best = max(found, key=lambda m: m.gain)
    near = [
        m
        for m in found
        if m.gain >= (1 - SIMPLER) * best.gain and m.median_gain >= (1 - SIMPLER) * best.median_gain
    ]
    fewest = min((len(m.bases) for m in near), default=len(best.bases))
    chosen = max((m for m in near if len(m.bases) == fewest), key=lambda m: m.gain, default=best)
    # the direction of motion is the simplest of the variables that hold it
    plain = {"velocity_sign" if v in ("velocity", "history") else v for v in chosen.variables}
    return next((m for m in near if set(m.variables) == plain), chosen)
