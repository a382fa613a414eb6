"""A compact formula in place of a map: few products of plain functions of the map's variables.

Orthogonal matching pursuit with several formulas kept at each length. The next term is looked for
among all products of two small libraries, one a variable; what is kept is decided by the error on
runs left out. Formulas that do about as well are all returned, since the data do not tell them
apart.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from estimation.diagnosis.balance import Balance
from estimation.diagnosis.candidate import Candidate
from estimation.diagnosis.design import columns_at
from estimation.diagnosis.evidence import leave_one_run_out
from estimation.diagnosis.formula_library import (
    Unary,
    candidate,
    library,
    live_channel,
    named,
    values,
    word,
)
from estimation.diagnosis.least_squares import orthonormal
from estimation.diagnosis.maps import SIMPLER, Map
from estimation.effects.unknown_product import Product
from estimation.recording import FloatArray

FACTORS = 2
"""Factors of a product."""

MOST_TERMS = 4
NEAR_EQUAL = 5
"""Formulas kept at each length, and returned at most."""

TRIED = 12
"""Next terms, each of other functions, that are held against runs left out."""

WORTH = 0.02
"""A further term removes at least this share of the squared error on runs left out."""

SAMPLES = 6000
"""Samples a search looks at, over all runs: the functions are slow."""


@dataclass(frozen=True)
class Formula:
    """A sum of products of functions.

    Attributes:
        terms: The products.
        weights: Their amplitudes, fitted on all discovery runs.
        gain: Share of squared error removed on discovery runs left out.
        words: Channel to the name of the variable.
    """

    terms: tuple[Candidate, ...]
    weights: tuple[float, ...]
    gain: float
    words: Mapping[str, str]

    @property
    def text(self) -> str:
        """The formula as a person writes it, in SI units."""
        weighed = zip(self.weights, self.products, strict=True)
        return " + ".join(f"{weight:.3g} {words}" for weight, words in weighed).replace("+ -", "- ")

    @property
    def products(self) -> list[str]:
        """Its terms in words, without their amplitudes."""
        return [self._in_words(term) for term in self.terms]

    def _in_words(self, term: Candidate) -> str:
        kind = term.effect
        assert isinstance(kind, Product)  # noqa: S101 - narrows the type
        names = {role: self.words[channel] for role, channel in term.channels}
        return kind.in_words(names, term.shape)

    def settled(self, terms: Sequence[Candidate], weights: FloatArray) -> "Formula":
        """Return the same formula as it stands at the end of a joint fit's effects.

        Args:
            terms: All effects of the fit, those of the formula last.
            weights: Their amplitudes; a formula's term has one each.
        """
        count = len(self.terms)
        own = tuple(float(w) for w in weights[-count:])
        return replace(self, terms=tuple(terms[-count:]), weights=own)


@dataclass
class _Partial:
    """A formula on its way: what is chosen, and what the next term may still explain.

    Attributes:
        terms: The products.
        columns: Their columns, shape (n, terms).
        held: Orthonormal basis of these, of what is refitted beside, and of the runs' means.
        left: Residual, orthogonal to it, shape (n,).
        power: Square of what is new in each product of the libraries, shape (first, second).
        gain: Share of squared error removed on runs left out.
    """

    terms: tuple[Candidate, ...]
    columns: FloatArray
    held: FloatArray
    left: FloatArray
    power: FloatArray
    gain: float = 0.0


@dataclass
class _Pursuit:
    """All products of two libraries, laid out on thinned discovery runs."""

    balance: Balance
    known: Sequence[Candidate]
    libraries: Sequence[Sequence[Unary]]
    values: list[FloatArray] = field(init=False)

    def __post_init__(self) -> None:
        runs = self.balance.runs
        self.step = step = max(1, math.ceil(sum(len(y) for y in self.balance.target) / SAMPLES))
        self.base = [b[::step] for b in self.balance.base(self.known)]
        self.left = [r[::step] for r in self.balance.left(self.known)]
        self.cuts = np.cumsum([len(r) for r in self.left])[:-1]
        self.values = [
            np.vstack([values(functions, run.channels)[run.kept][::step] for run in runs])
            for functions in self.libraries
        ]
        fixed = np.vstack(self.base)
        if self.balance.demean:
            ones = [np.ones(len(r)) for r in self.left]
            fixed = np.hstack([fixed, *(self._alone(k, one) for k, one in enumerate(ones))])
        self.fixed = orthonormal(fixed)

    def _alone(self, k: int, ones: FloatArray) -> FloatArray:
        parts = [ones if k == j else np.zeros(len(r)) for j, r in enumerate(self.left)]
        return np.concatenate(parts)[:, None]

    def start(self) -> _Partial:
        """Return the empty formula."""
        first, second = self.values
        power = (first**2).T @ second**2
        whole = power.copy()
        for q in self.fixed.T:
            power -= ((first * q[:, None]).T @ second) ** 2
        power[power < 1e-6 * whole] = np.inf  # nothing of it is new
        left = np.concatenate(self.left)
        left = left - self.fixed @ (self.fixed.T @ left)
        return _Partial((), np.empty((len(left), 0)), self.fixed, left, power)

    def longer(self, partial: _Partial) -> list[_Partial]:
        """Return the formulas of one term more that look best, scored on runs left out."""
        first, second = self.values
        score = ((first * partial.left[:, None]).T @ second) ** 2 / partial.power
        best: dict[str, tuple[int, int]] = {}
        for at in np.argsort(-score, axis=None):
            i, j = np.unravel_index(at, score.shape)
            forms = named(self.libraries[0][i], self.libraries[1][j])
            if not forms or score[i, j] <= 0 or len(best) == TRIED:
                continue
            best.setdefault(f"{forms}{self._channels(int(i), int(j))}", (int(i), int(j)))
        found = []
        for i, j in best.values():
            pair = (self.libraries[0][i], self.libraries[1][j])
            found.append(self._with(partial, candidate(*pair), first[:, i] * second[:, j]))
        return self._scored(found)

    def refined(self, found: Sequence[_Partial]) -> list[_Partial]:
        """Return the formulas with their shapes moved from the grid to where the fit is best."""
        moved = []
        for one in found:
            count = len(one.terms)
            best = self.balance.refined([*self.known, *one.terms], last=count)[-count:]
            partial = self.start()
            for term in best:
                partial = self._with(partial, term, self._column(term))
            moved.append(partial)
        return self._scored(moved)

    def _column(self, term: Candidate) -> FloatArray:
        columns = [columns_at(run, term)[:: self.step, 0] for run in self.balance.runs]
        return np.concatenate(columns)

    def _channels(self, i: int, j: int) -> list[str]:
        pair = (self.libraries[0][i], self.libraries[1][j])
        return [unary.channel for unary in pair if unary.form]

    def _with(self, partial: _Partial, term: Candidate, column: FloatArray) -> _Partial:
        first, second = self.values
        q = column
        for _ in range(2):  # once more for what rounding leaves
            q = q - partial.held @ (partial.held.T @ q)
        q = q / max(float(np.linalg.norm(q)), np.finfo(float).tiny)
        power = partial.power - ((first * q[:, None]).T @ second) ** 2
        power[power < 1e-6 * partial.power] = np.inf
        return _Partial(
            (*partial.terms, term),
            np.column_stack([partial.columns, column]),
            np.column_stack([partial.held, q]),
            partial.left - q * (q @ partial.left),
            power,
        )

    def _scored(self, found: Sequence[_Partial]) -> list[_Partial]:
        """Return the same formulas with their gain on runs left out."""
        return [replace(one, gain=g) for g, one in zip(self._gains(found), found, strict=True)]

    def _gains(self, found: Sequence[_Partial]) -> list[float]:
        if not found:
            return []
        joined = np.hstack([one.columns for one in found])
        blocks = np.split(joined, self.cuts)
        if self.balance.demean:
            blocks = [b - b.mean(axis=0) for b in blocks]
        sizes = [one.columns.shape[1] for one in found]
        losses = leave_one_run_out(self.base, blocks, sizes, [r[:, None] for r in self.left])
        return [float(gain) for gain in losses.gain[:, 0]]


def formulas(balance: Balance, terms: Sequence[Candidate], found: Map) -> tuple[Formula, ...]:
    """Return the formulas that stand for a map about equally well, the shortest first.

    Args:
        balance: The balance on the runs that discover.
        terms: Declared effects and those that are kept beside the map.
        found: The map; no other variables are used.

    Returns:
        At most `NEAR_EQUAL`; none where a variable has no channel that a model can read live, where
        there are more variables than a product has factors, or where no formula predicts a run left
        out.
    """
    channels = {basis.variable: live_channel(balance, basis) for basis in found.bases}
    if None in channels.values() or len(channels) > FACTORS:
        return ()
    libraries = [library(basis, str(channels[basis.variable])) for basis in found.bases]
    constant = [Unary(None, "")]
    pair = [[*constant, *functions] for functions in libraries]
    pair += [constant] * (FACTORS - len(libraries))
    pursuit = _Pursuit(balance, terms, pair)
    kept = [pursuit.start()]
    every: list[_Partial] = []
    reached = 0.0
    for _ in range(MOST_TERMS):
        longer = _distinct([new for partial in kept for new in pursuit.longer(partial)])
        kept = _distinct(pursuit.refined(longer[:NEAR_EQUAL]))
        if not kept or kept[0].gain < reached + WORTH:
            break
        reached = kept[0].gain
        every += kept
    near = [one for one in every if one.gain >= (1 - SIMPLER) * reached]
    near.sort(key=lambda one: (len(one.terms), -one.gain))
    words = {str(channels[basis.variable]): word(basis) for basis in found.bases}
    return tuple(_fitted(balance, terms, one.terms, words) for one in near[:NEAR_EQUAL])


def _fitted(
    balance: Balance,
    terms: Sequence[Candidate],
    products: tuple[Candidate, ...],
    words: Mapping[str, str],
) -> Formula:
    count = len(products)
    weights = balance.solve([*terms, *products])[-count:]
    aims = [r[:, None] for r in balance.left(terms)]
    losses = leave_one_run_out(balance.base(terms), balance.columns(products), [count], aims)
    return Formula(products, tuple(float(w) for w in weights), float(losses.gain[0, 0]), words)


def _distinct(found: Sequence[_Partial]) -> list[_Partial]:
    """Return the best formula of each set of functions, best first."""
    best: dict[tuple[tuple[str, tuple[tuple[str, str], ...]], ...], _Partial] = {}
    for one in sorted(found, key=lambda one: -one.gain):
        best.setdefault(tuple(sorted((t.id, t.channels) for t in one.terms)), one)
    return list(best.values())
