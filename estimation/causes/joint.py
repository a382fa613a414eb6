"""All equations as one regression, cross-validated over runs and over levels of the conditions.

The declared parameters, an offset of each equation and the amplitudes of every cause are one
vector. Each equation has two residuals: within runs, and of the runs' means. Everything that a
score needs is in cross-products of one run, worked out once, so a fold costs one small solve.
"""

import itertools
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimation.causes.equations import SHAPE_STEP
from estimation.causes.instruments import declared_of, instead_noise
from estimation.causes.laid import TINY, Followed, Laid, Part, Projection, centred, inverse
from estimation.causes.layout import Layout
from estimation.causes.numbers import DEFAULT, Numbers
from estimation.recording import FloatArray
from estimation.within_bounds import solve_within

HELD = 1e6
"""Precision of an amplitude that is held, in squares of its column: as good as no column."""

Family = Sequence[Sequence[int]]
"""Folds of one kind: each is the runs that are left out together."""


class LeftOut(NamedTuple):
    """The base fitted without the runs of each fold of a family.

    Attributes:
        left: Which runs each fold omits, shape (folds, runs), 0 or 1.
        runs: The runs left out by some fold, shape (n,).
        fold: The fold that omits each of them, shape (n,).
        inverse: Of the normal matrices, shape (folds, base, base).
        base: Parameters, shape (folds, base).
    """

    left: FloatArray
    runs: NDArray[np.intp]
    fold: NDArray[np.intp]
    inverse: FloatArray
    base: FloatArray


class Next(NamedTuple):
    """Causes next to a base, with parameters.

    Attributes:
        followed: The noise that they follow.
        amplitudes: Theirs in each run, shape (n, causes, k).
        taken: What their columns take off the declared parameters, shape (n, causes, declared).
    """

    followed: Followed
    amplitudes: FloatArray
    taken: FloatArray


class Joint:
    """The stacked regression of some runs. Causes that were accepted are part of its base.

    Attributes:
        layout: The equations and runs.
        parts: The residuals, in one order.
        samples: Part to the samples of each run, shape (runs,).
        error: Part to the mean squared residual of the declared model.
        weights: Part to the weight of one of its squared residuals.
        tables: Part to the columns of the base and, last, the target: (runs, samples, columns).
        at: Part to the parameters of the base whose columns are in its table.
        gram: Part to the cross-products of all parameters and, last, the target, of each run.
        declared: Parameters of the declared model on all runs.
        projection: Lays candidates out.
        power: Weighted square of all targets within runs.
        held: Which declared amplitudes are held at zero, their bound, shape (declared,): what takes
            a friction or a damping below zero is a cause that the equation lacks.
    """

    def __init__(self, layout: Layout, numbers: Numbers = DEFAULT) -> None:
        self.layout, self.numbers = layout, numbers
        self.runs = layout.runs
        counts = [len(equation.kinds) for equation in layout.equations.values()]
        ends = itertools.pairwise(itertools.accumulate(counts, initial=0))
        self._equations_at = {n: range(*at) for n, at in zip(layout.equations, ends, strict=True)}
        self._added, self.taken = np.zeros(0), np.zeros((self._declared_size, 0))
        self._fits: dict[tuple[tuple[int, ...], ...], LeftOut] = {}
        self.tables: dict[Part, FloatArray] = {}
        self.at: dict[Part, Sequence[int]] = {}
        self.samples: dict[Part, FloatArray] = {}
        for name in layout.equations:
            self._lay_out(name)
        self.parts = [*self.tables]
        self.gram = self._products()
        noise = {
            name: centred([e.noise(r)[r.grid[r.used[name]]] for r in self.runs])[0]
            for name, e in layout.equations.items()
        }
        self._white, self._noise = noise, self._noise_products(noise)
        self._weigh()
        self.declared = self.left_out(((),)).base[0]
        weights = self.weights
        self.projection = Projection(
            {e.name: [declared_of(e, r) for r in self.runs] for e in layout.equations.values()},
            noise,
            instead_noise(layout),
            {n: (weights[n, "within"], weights[n, "between"]) for n in layout.equations},
            {name: self._precision[[*at]] for name, at in self._equations_at.items()},
        )
        self.power = sum(
            weights[p] * float(self.gram[p][:, -1, -1].sum())
            for p in self.parts
            if p[1] == "within"
        )

    @property
    def size(self) -> int:
        """Parameters of the base."""
        return self._declared_size + len(self._added)

    @property
    def _declared_size(self) -> int:
        """Declared parameters and the offset of each equation."""
        return sum(map(len, self._equations_at.values())) + len(self._equations_at)

    def offset_at(self, equation: str) -> int:
        """Return the place of an equation's offset: they follow all declared parameters."""
        names = [*self._equations_at]
        return self._declared_size - len(names) + names.index(equation)

    # ---- the base

    def _lay_out(self, name: str) -> None:
        """Add the tables of an equation, within runs and between them."""
        equation, columns, at = self.layout.equations[name], [], [*self._equations_at[name]]
        for run in self.runs:
            used = run.grid[run.used[name]]
            target = run.channels[equation.target][used, None]
            columns.append(np.hstack([equation.columns(run.channels)[used], target]))
        inner, means = centred(columns)
        one = np.ones((len(means), 1))
        self.tables[name, "within"], self.at[name, "within"] = inner, at
        self.tables[name, "between"] = np.hstack([means[:, :-1], one, means[:, -1:]])[:, None]
        self.at[name, "between"] = [*at, self.offset_at(name)]
        self.samples[name, "within"] = np.array([float(len(own)) for own in columns])
        self.samples[name, "between"] = np.ones(len(means))

    def _products(self) -> Mapping[Part, FloatArray]:
        out = {}
        for p, table in self.tables.items():
            out[p] = np.zeros((len(table), self.size + 1, self.size + 1))
            places = [*self.at[p], self.size]
            rows, columns = np.ix_(places, places)
            out[p][:, rows, columns] = table.transpose(0, 2, 1) @ table
        return out

    def _weigh(self) -> None:
        """Work out the mean squared residual of the declared model in each part, and the fits."""
        self.error, count = dict.fromkeys(self.parts, 1.0), len(self.runs)
        self._prepare()
        for _ in range(5):
            vector, error = np.append(self.left_out(((),)).base[0], -1.0), dict[Part, float]()
            for p in self.parts:
                value = float(np.einsum("i,rij,j->", vector, self.gram[p], vector))
                spare = count / max(1, count - 3) if p[1] == "between" else 1.0
                error[p] = max(spare * value / self.samples[p].sum(), TINY)
            for name in self.layout.equations:
                if not self.has_offsets(name):  # a mean is no less certain than one sample
                    part = name, "between"
                    error[part] = min(error[part], error[name, "within"])
            self.error = error
            self._prepare()

    def _prepare(self) -> None:
        """Work out what all fits of this base share."""
        each = self.numbers.samples_a_run
        self.weights = {
            p: (each / self.samples[p].mean() if p[1] == "within" else 1.0) / self.error[p]
            for p in self.parts
        }
        self._run_grams = np.asarray(sum(self.weights[p] * self.gram[p] for p in self.parts))
        whole = self._run_grams.sum(axis=0)
        # no term exceeds half of all signals, and a shape is known to within its own size
        size = self._declared_size
        self._precision = 4.0 * np.diag(whole)[:size] / self._signals(whole)
        shapes = [c.of_shape for e in self.layout.equations.values() for c in e.kinds]
        self._precision[: len(shapes)] += np.where(shapes, (2.0 * SHAPE_STEP) ** 2, 0.0)
        self._unheld = self._precision
        bounded = np.zeros(size, dtype=np.bool_)
        kinds = [c for e in self.layout.equations.values() for c in e.kinds]
        bounded[: len(kinds)] = [c.is_bounded for c in kinds]
        self._hold(np.zeros_like(bounded))
        if (self._amplitudes[bounded] < 0.0).any():
            self._hold(bounded & (self._within_bounds(bounded) <= 0.0))

    def _signals(self, whole: FloatArray) -> float:
        """Return the weighted square of all targets, or of all terms of the declared model if more.

        With next to no load these are many times as large.
        """
        fitted = np.zeros(self._declared_size)
        for name, equation in self.layout.equations.items():
            fitted[[*self._equations_at[name]]] = equation.fitted
        return float(max(whole[-1, -1], fitted**2 @ np.diag(whole)[: len(fitted)]))

    @property
    def _amplitudes(self) -> FloatArray:
        """Amplitudes of the declared columns on all runs."""
        return self.whole(self.left_out(((),)).base[0])

    def _within_bounds(self, bounded: NDArray[np.bool_]) -> FloatArray:
        """Return the amplitudes of the declared columns where some are not below zero."""
        size = self._declared_size
        # to the amplitudes as they are bounded, next to what was taken off them
        turn = np.eye(self.size)
        turn[:size, size:] = self.taken
        gram = self._run_grams.sum(axis=0)
        normal = turn.T @ (gram[:-1, :-1] + self._prior) @ turn
        low = np.append(np.where(bounded, 0.0, -np.inf), np.full(len(self._added), -np.inf))
        high = np.full(len(low), np.inf)
        return solve_within(normal, turn.T @ gram[:-1, -1], low, high)[:size]

    def _hold(self, held: NDArray[np.bool_]) -> None:
        """Hold declared amplitudes at their bound of zero, shape (declared,)."""
        size, power = self._declared_size, np.diag(self._run_grams.sum(axis=0))
        self.held, self._fits = held, {}
        self._precision = self._unheld + np.where(held, HELD * power[:size], 0.0)
        self._prior = np.diag(np.append(self._precision, self._added))
        self._prior[:, size:] += self.prior_products(self.taken)
        self._prior[size:, :size] = self._prior[:size, size:].T

    def holding(self, held: NDArray[np.bool_]) -> "Joint":
        """Return the regression with other declared amplitudes held at their bound of zero."""
        made = object.__new__(Joint)
        made.__dict__.update(self.__dict__)
        made._hold(held)
        return made

    def left_out(self, family: Family) -> LeftOut:
        """Return the base fitted without the runs of each fold."""
        key = tuple(map(tuple, family))
        if key not in self._fits:
            left = np.zeros((len(family), len(self.runs)))
            for own, without in zip(left, family, strict=True):
                own[list(without)] = 1.0
            fold, runs = np.nonzero(left)
            gram = self._run_grams.sum(axis=0) - np.tensordot(left, self._run_grams, 1)
            gram[:, :-1, :-1] += self._prior
            inverses = inverse(gram[:, :-1, :-1])
            base = np.einsum("fij,fj->fi", inverses, gram[:, :-1, -1])
            self._fits[key] = LeftOut(left, runs, fold, inverses, base)
        return self._fits[key]

    def unlike(self, acts: Sequence[bool]) -> float:
        """Return how little some runs are a factor times what the others predict.

        It is the share of the targets' squares that the factor does not explain, or the same of the
        other runs if that is larger.

        Args:
            acts: Whether each run is one of them, shape (runs,).
        """
        both = [[k for k, one in enumerate(acts) if one == kind] for kind in (True, False)]
        shares = list[float]()
        for of, runs in zip(self.left_out(both).base, both, strict=True):
            gram = self._run_grams[runs].sum(axis=0)
            across = float(of @ gram[:-1, -1])
            squares = float(gram[-1, -1]) * float(of @ gram[:-1, :-1] @ of)
            shares.append(1.0 - across * abs(across) / (squares + TINY))
        return max(shares)

    def prior_products(self, taken: FloatArray) -> FloatArray:
        """Return the prior's products of the base with causes that declared columns were taken off.

        The prior is that of the declared parameters themselves, not of what is left of them next to
        a cause. Otherwise it would say how large a cause is in runs that show nothing of it. Shapes
        (..., declared, k) of what was taken off, and (..., base, k) of the products.
        """
        of_declared = -self._precision[:, None] * taken
        return np.concatenate([of_declared, -self.taken.T @ of_declared], axis=-2)

    def fitted_on(self, counts: FloatArray) -> FloatArray:
        """Return the base's parameters with each run counted so many times, shape (base,)."""
        gram = np.einsum("r,rij->ij", counts, self._run_grams)
        gram[:-1, :-1] += self._prior
        return np.asarray(inverse(gram[:-1, :-1]) @ gram[:-1, -1])

    def declared_products(self, part: Part) -> FloatArray:
        """Return the products of an equation's amplitudes, its offset and its target, of all runs.

        Shapes stay as they were fitted: an amplitude and the derivative by a shape may be much
        alike, as a gap and its compliance.
        """
        name, _ = part
        kinds = self.layout.equations[name].kinds
        at = [k for k, c in zip(self._equations_at[name], kinds, strict=True) if not c.of_shape]
        at += [self.offset_at(name), self.size]
        return np.asarray(self.gram[part].sum(axis=0)[np.ix_(at, at)])

    def parameter(self, base: FloatArray, equation: str, column: int | None) -> float:
        """Return a declared parameter of a base, with what was taken off the columns of causes.

        That of a declared column of an equation, or of its offset where the column is None.
        """
        if column is not None:
            return float(self.whole(base)[self._equations_at[equation].start + column])
        return float(base[self.offset_at(equation)])

    def with_effect(self, laid: Laid, amplitudes: FloatArray) -> "Joint":
        """Return the regression as if the base were true but for one effect of some amplitudes.

        Within runs the targets are those of the base, with the noise of the readings, and the
        effect. Between runs they keep the residual.
        """
        made = object.__new__(Joint)
        made.__dict__.update(self.__dict__)
        base = self.left_out(((),)).base[0]
        made.tables = {p: table.copy() for p, table in self.tables.items()}
        for p, table in made.tables.items():
            name, kind = p
            if kind == "within":
                usual = np.append(self.declared[[*self._equations_at[name]]], -1.0)
                table[..., -1] = table[..., :-1] @ base[self.at[p]] - self._white[name] @ usual
            if (columns := laid.part(p)) is not None:
                table[..., -1] += columns[:, 0] @ amplitudes
        made.gram = made._products()
        made._weigh()
        made.declared = made.whole(made.left_out(((),)).base[0])
        for worked_out in ("largest_linear", "noise_in_error"):
            made.__dict__.pop(worked_out, None)
        return made

    def with_cause(self, laid: Laid, precision: FloatArray) -> "Joint":
        """Return the regression with a cause's columns, of a prior precision each, in its base."""
        made = object.__new__(Joint)
        made.__dict__.update(self.__dict__)
        made._added = np.append(self._added, precision)
        made.taken = np.hstack([self.taken, self.taken_off(laid)[0]])
        made.tables, made.at = {}, {}
        new = range(self.size, self.size + len(precision))
        for p, table in self.tables.items():
            made.tables[p], made.at[p] = table, self.at[p]
            if (columns := laid.part(p)) is not None:
                parts = [table[..., :-1], columns[:, 0], table[..., -1:]]
                made.tables[p], made.at[p] = np.concatenate(parts, axis=2), [*self.at[p], *new]
        made.gram = made._products()
        made._noise = {name: self._grown_noise(name, laid) for name in self._noise}
        made._prepare()
        return made

    def _grown_noise(self, name: str, laid: Laid) -> FloatArray:
        """Return an equation's noise products with those of one more cause before the target's."""
        old, k = self._noise[name], laid.size.shape[1]
        new = range(self.size, self.size + k)
        kept = [*range(self.size), self.size + k]
        out = np.zeros((len(old), self.size + k + 1, self.size + k + 1))
        out[:, np.array(kept)[:, None], kept] = old
        if name in laid.followed.across:
            there = [*self._equations_at[name], -1]
            across = laid.followed.across[name][:, 0]
            out[:, np.array(there)[:, None], new] = across
            out[:, np.array(new)[:, None], there] = across.transpose(0, 2, 1)
            out[:, np.array(new)[:, None], new] = laid.followed.own[name][:, 0]
        return out

    # ---- noise of what is read

    def _noise_products(self, noise: Mapping[str, FloatArray]) -> Mapping[str, FloatArray]:
        """Return the noise in the cross-products within runs; the target's own is left in."""
        size = self._declared_size + 1
        out = {}
        for name, table in noise.items():
            places = np.array([*self._equations_at[name], size - 1])
            kept = [*np.flatnonzero(table[..., :-1].any(axis=(0, 1))), -1]
            inner = np.ix_(places[kept], places[kept])
            out[name] = np.zeros((len(self.runs), size, size))
            for r, own in enumerate(table[..., kept]):
                product = own.T @ own
                product[-1, -1] = 0.0
                out[name][r][inner] = _at_most(product, self.gram[name, "within"][r][inner])
        return out

    def avoided(
        self,
        part: Part,
        runs: NDArray[np.intp],
        base: FloatArray,
        next_to: "Next | None" = None,
    ) -> FloatArray:
        """Return the error that is missing because less of the readings' noise is in a residual.

        A cause that stands in for a noisy reading, or follows its noise, removes that noise. The
        squared error that it removes so is put back, (n, causes), in n runs with a base of
        parameters (n, causes, base) each.
        """
        name, kind = part
        if kind == "between":
            return np.zeros(base.shape[:-1])
        noise, whole = self._noise[name][runs], self.whole(base)
        if next_to is not None:
            whole = whole - next_to.taken
        target = np.full((*whole.shape[:-1], 1), -1.0)
        now = np.concatenate([whole, base[..., self._declared_size :], target], axis=-1)
        usual = np.concatenate([self.declared, np.zeros(len(self._added)), [-1.0]])
        left = ((now @ noise) * now).sum(axis=-1)
        if next_to is not None and name in next_to.followed.across:
            followed, amplitudes = next_to.followed, next_to.amplitudes
            there = now[..., [*self._equations_at[name], -1]]
            follows = (there[:, :, None] @ followed.across[name][runs])[:, :, 0]
            itself = (amplitudes[:, :, None] @ followed.own[name][runs])[:, :, 0]
            left = left + ((2.0 * follows + itself) * amplitudes).sum(axis=-1)
        return np.asarray(np.maximum(((noise @ usual) @ usual)[:, None] - left, 0.0))

    def whole(self, base: FloatArray) -> FloatArray:
        """Return amplitudes of the declared columns, with what was taken off those of causes."""
        count = self._declared_size
        return np.asarray(base[..., :count] - base[..., count:] @ self.taken.T)

    def taken_off(self, laid: Laid) -> FloatArray:
        """Return how much of every declared column was taken off causes' (causes, declared, k)."""
        out = np.zeros((len(laid), self._declared_size, laid.size.shape[1]))
        for name, taken in laid.taken.items():
            out[:, self._equations_at[name]] = taken
        return out

    def has_offsets(self, equation: str) -> bool:
        """Whether the runs have offsets of their own in an equation."""
        return self.layout.equations[equation].model.run_offsets

    def bounded_at(self, equation: str, column: int | None) -> int | None:
        """Return the place of a declared column's amplitude if it cannot be negative."""
        if column is None or not self.layout.equations[equation].kinds[column].is_bounded:
            return None
        return self._equations_at[equation].start + column

    def linear(self, name: str) -> Mapping[int, str]:
        """Return place to channel of each declared column that is a channel times a constant."""
        kinds = self.layout.equations[name].kinds
        places = zip(self._equations_at[name], kinds, strict=True)
        return {at: column.channel for at, column in places if column.channel}

    def weights_of(self, name: str) -> Mapping[str, float]:
        """Return channel to weight of the terms that are a constant times it, next to the base."""
        base, found = self.whole(self.left_out(((),)).base[0]), dict[str, float]()
        kinds = self.layout.equations[name].kinds
        for at, (sign, channel, *_) in zip(self._equations_at[name], kinds, strict=True):
            if channel:
                found[channel] = found.get(channel, 0.0) + sign * float(base[at])
        return found

    @cached_property
    def noise_in_error(self) -> Mapping[str, Mapping[int, float]]:
        """Return how much of an equation's error within runs each reading's noise may be.

        Equation to place of a declared column to a share, at most one. The noise is at most the
        reading's own changes, and the error of every equation that the reading enters.
        """
        linear = {name: self.linear(name) for name in self.layout.equations}
        most: dict[str, float] = {}
        for name, equation in self.layout.equations.items():
            error = self.error[name, "within"]
            entered = [(c, float(self.declared[at])) for at, c in linear[name].items()]
            for channel, factor in (*entered, (equation.target, 1.0)):
                if factor:
                    most[channel] = min(most.get(channel, np.inf), error / factor**2)
        shares: dict[str, dict[int, float]] = {}
        for name, places in linear.items():
            part = name, "within"
            own = np.einsum("rii->i", self.gram[part]) / self.samples[part].sum()
            shares[name] = {
                at: min(
                    1.0,
                    min(float(own[at]), most.get(channel, np.inf))
                    * float(self.declared[at]) ** 2
                    / self.error[part],
                )
                for at, channel in places.items()
            }
        return shares

    @cached_property
    def largest_linear(self) -> Mapping[str, int]:
        """Return the place of each equation's largest channel times a constant."""
        out = {}
        for name in self.layout.equations:
            linear = self.linear(name)
            samples, means = self.samples[name, "within"], self.gram[name, "between"]
            whole = self.gram[name, "within"].sum(axis=0) + np.tensordot(samples, means, 1)
            power = self.declared**2 * np.diag(whole)[: len(self.declared)]
            if linear:
                out[name] = max(linear, key=lambda at: float(power[at]))
        return out


def _at_most(noise: FloatArray, gram: FloatArray) -> FloatArray:
    """Return noise products of columns and target, less than the columns' own in any direction."""
    scale = 1.0 / np.sqrt(np.diag(gram)[:-1] + TINY)
    inner = gram[:-1, :-1] * np.outer(scale, scale) + 1e-8 * np.eye(len(scale))
    root = np.linalg.cholesky(inner)
    turned = np.linalg.solve(root, noise[:-1, :-1] * np.outer(scale, scale))
    share, axes = np.linalg.eigh(np.linalg.solve(root, turned.T))
    kept = root @ (axes * np.clip(share, 0.0, 1.0)) @ axes.T @ root.T
    out = noise.copy()
    out[:-1, :-1] = kept / np.outer(scale, scale)
    return out
