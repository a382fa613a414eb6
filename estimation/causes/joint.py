"""All equations as one regression, cross-validated over runs and over levels of the conditions.

The declared parameters, an offset of each equation and the amplitudes of every cause are one
vector. Each equation has two residuals: within runs, and of the runs' means. Everything that a
score needs is in cross-products of one run, worked out once, so a fold costs one small solve.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from estimation.causes.equations import SHAPE_STEP, Layout, RunSignals
from estimation.causes.folds import Folds
from estimation.causes.instruments import signal
from estimation.causes.numbers import DEFAULT, Numbers
from estimation.recording import FloatArray

Part = tuple[str, str]
"""An equation and `within` runs or `between` them."""

Columns = Mapping[Part, FloatArray]

Scale = Literal["each", "first", "none"]
"""Of which columns the norm is one: of each, of the first, or of none."""

TINY = 1e-300

MOST_CHANGE = 2.0
"""Factor by which the largest linear term of an equation may change next to a cause."""


@dataclass(frozen=True)
class Laid:
    """A candidate's columns without what the declared columns explain.

    Attributes:
        columns: Part to the columns, one mapping a run.
        taken: How much of each declared column was taken off, equation to (declared, k).
        size: What the columns were divided by, shape (k,).
    """

    columns: Sequence[Columns]
    taken: Mapping[str, FloatArray]
    size: FloatArray


@dataclass(frozen=True)
class Block:
    """Cross-products of candidates with as many columns each, run by run.

    Attributes:
        base: Part to candidates' columns times the base's, shape (runs, candidates, base, k).
        own: Part to candidates' columns times themselves, shape (runs, candidates, k, k).
        target: Part to candidates' columns times the target, shape (runs, candidates, k).
        taken: How much of each declared column was taken off them, (candidates, declared, k).
    """

    base: Mapping[Part, FloatArray]
    own: Mapping[Part, FloatArray]
    target: Mapping[Part, FloatArray]
    taken: FloatArray


@dataclass(frozen=True)
class Outcome:
    """Candidates of one block, fitted and left out.

    Attributes:
        errors: For each family of folds, part to squared error, shape (runs, candidates).
        amplitudes: On all runs, shape (candidates, k).
        base: Parameters of the base on all runs, shape (candidates, base).
        cross: Products of the columns with the base's residual within runs, weighted, shape
            (runs, candidates, k).
        own: Products of the columns with themselves, shape (runs, candidates, k, k).
    """

    errors: Sequence[Mapping[Part, FloatArray]]
    amplitudes: FloatArray
    base: FloatArray
    cross: FloatArray
    own: FloatArray


class Joint:
    """The stacked regression of some runs. Causes that were accepted are part of its base."""

    def __init__(self, layout: Layout, numbers: Numbers = DEFAULT) -> None:
        self.layout, self.numbers = layout, numbers
        self.runs = layout.runs
        self.parts: list[Part] = [
            (name, kind) for name in layout.equations for kind in ("within", "between")
        ]
        self._tables: list[dict[Part, FloatArray]] = [self._laid(run) for run in self.runs]
        self.samples = {p: np.array([float(len(t[p])) for t in self._tables]) for p in self.parts}
        self._gram, self._added = self._products(), np.zeros(0)
        self._declared_size = self.size
        self._taken = np.zeros((self.size, 0))
        self._noise = self._noise_products()
        self.error = self._declared_error()
        self._prepare()
        self._declared = self._fitted()[1]
        self._instrumented = [self._instruments(run) for run in self.runs]
        self._projector = self._projectors()
        weights = self.weights
        self.power = sum(
            weights[p] * float(t[p][:, -1] @ t[p][:, -1])
            for t in self._tables
            for p in self.parts
            if p[1] == "within"
        )

    @property
    def weights(self) -> Mapping[Part, float]:
        """Weight of one squared residual of each part."""
        return {
            p: (self.numbers.samples_a_run / self.samples[p].mean() if p[1] == "within" else 1.0)
            / self.error[p]
            for p in self.parts
        }

    @property
    def size(self) -> int:
        """Parameters of the base."""
        return int(self._tables[0][self.parts[0]].shape[1]) - 1

    # ---- laying out

    def _laid(self, run: RunSignals) -> dict[Part, FloatArray]:
        equations = list(self.layout.equations.values())
        widths = [e.columns(_first(run)).shape[1] for e in equations]
        total, at, out = sum(widths) + len(equations), 0, {}
        for k, (equation, width) in enumerate(zip(equations, widths, strict=True)):
            used = run.grid[run.used[equation.name]]
            table = np.zeros((len(used), total + 1))
            table[:, at : at + width] = equation.columns(run.channels)[used]
            table[:, -1] = run.channels[equation.target][used]
            mean = table.mean(axis=0)
            out[equation.name, "within"] = table - mean
            mean[sum(widths) + k] = 1.0
            out[equation.name, "between"] = mean[None]
            at += width
        return out

    def _instruments(self, run: RunSignals) -> dict[str, FloatArray]:
        out = {}
        for equation in self.layout.equations.values():
            seen = dict(run.channels)
            for channel in equation.channels:
                seen[channel] = run.channels[signal(run, channel, equation.name)]
                if "_rate_" in channel:
                    source = channel.replace("_rate_n_m_s", "_n_m")
                    seen[channel] = (
                        np.gradient(run.channels[signal(run, source, equation.name)]) * run.rate_hz
                    )
            used = run.grid[run.used[equation.name]]
            out[equation.name] = equation.columns(seen)[used]
        return out

    def _projectors(self) -> Mapping[str, FloatArray]:
        out, weights = {}, self.weights
        for name in self.layout.equations:
            total: FloatArray = np.zeros(())
            for own in self._instrumented:
                mean = np.append(own[name].mean(axis=0), 1.0)
                inner = np.pad(own[name] - mean[:-1], ((0, 0), (0, 1)))
                total = total + weights[name, "within"] * inner.T @ inner
                total = total + weights[name, "between"] * np.outer(mean, mean)
            out[name] = _inverse(total)
        return out

    def _products(self) -> Mapping[Part, FloatArray]:
        return {p: np.array([t[p].T @ t[p] for t in self._tables]) for p in self.parts}

    def _declared_error(self) -> Mapping[Part, float]:
        """Return the mean squared residual of the declared model in each part."""
        error, count = dict.fromkeys(self.parts, 1.0), len(self.runs)
        for _ in range(5):
            self.error = error
            self._prepare()
            vector = np.append(self._fitted()[1], -1.0)
            for p in self.parts:
                value = float(np.einsum("i,rij,j->", vector, self._gram[p], vector))
                spare = count / max(1, count - 3) if p[1] == "between" else 1.0
                error[p] = max(spare * value / self.samples[p].sum(), TINY)
        return error

    def _avoided(self, part: Part, run: int, declared: FloatArray) -> FloatArray:
        """Return the error that is missing because a noisy reading got a smaller amplitude.

        A cause that stands in for a noisy reading removes that reading's noise. The
        error that it removes so is put back.

        Args:
            part: Of the regression.
            run: Number of the run.
            declared: Amplitudes of the declared columns, whole ones, shape (..., declared).
        """
        if part[1] == "between":
            return np.zeros(declared.shape[:-1])
        noise = self._noise[part][run]

        def shown(own: FloatArray) -> FloatArray:
            return np.asarray(((own @ noise[:-1, :-1]) * own).sum(-1) - 2.0 * own @ noise[:-1, -1])

        return np.maximum(shown(self._declared) - shown(declared), 0.0)

    def _whole(self, base: FloatArray) -> FloatArray:
        """Return amplitudes of the declared columns, with what was taken off those of causes.

        Args:
            base: Parameters of the base, shape (..., base).
        """
        count = base.shape[-1] - self._taken.shape[1]
        return np.asarray(base[..., :count] - base[..., count:] @ self._taken.T)

    def _taken_off(self, laid: Laid) -> FloatArray:
        """Return how much of every declared column was taken off a cause's, (declared, k)."""
        rows = []
        for equation in self.layout.equations.values():
            none = np.zeros((len(equation.of_channel), len(laid.size)))
            rows.append(laid.taken.get(equation.name, none))
        return np.vstack([*rows, np.zeros((len(self.layout.equations), len(laid.size)))])

    def _noise_products(self) -> Mapping[Part, FloatArray]:
        """Return the noise in the cross-products within runs; the target's own is left in."""
        at, size = 0, self._declared_size + 1
        out = {p: np.zeros((len(self.runs), size, size)) for p in self.parts}
        for equation in self.layout.equations.values():
            part = (equation.name, "within")
            for r, run in enumerate(self.runs):
                noise = equation.noise(run)[run.grid[run.used[equation.name]]]
                noisy = np.flatnonzero(noise[:, :-1].any(axis=0))
                noise = noise[:, [*noisy, -1]]
                product = noise.T @ noise
                product[-1, -1] = 0.0
                inner = np.ix_(*[[*(at + noisy), size - 1]] * 2)
                out[part][r][inner] = _at_most(product, self._gram[part][r][inner])
            at += len(equation.of_channel)
        return out

    def _weighted(self) -> FloatArray:
        """Return the weighted cross-products of each run."""
        weights = self.weights
        return np.asarray(sum((weights[p] * self._gram[p] for p in self.parts), np.zeros(())))

    def _fitted(self, left_out: Sequence[int] = ()) -> tuple[FloatArray, FloatArray]:
        """Return the inverse of the base's normal matrix without some runs, and its parameters."""
        key = tuple(left_out)
        if key not in self._fits:
            gram = self._whole_gram - self._run_grams[list(key)].sum(axis=0)
            gram[np.diag_indices(self.size)] += self._prior
            inverse = _inverse(gram[:-1, :-1])
            self._fits[key] = inverse, np.asarray(inverse @ gram[:-1, -1])
        return self._fits[key]

    def _prepare(self) -> None:
        """Work out what all fits of this base share."""
        self._run_grams = self._weighted()
        self._whole_gram = self._run_grams.sum(axis=0)
        self._prior = self._prior_precision()
        self._fits: dict[tuple[int, ...], tuple[FloatArray, FloatArray]] = {}

    def _prior_precision(self) -> FloatArray:
        """Return the prior precision of the base: no term exceeds half of all signals.

        A shape is known to within its own size.
        """
        weights = self.weights
        whole = sum(
            (weights[p] * self._gram[p].sum(axis=0) for p in self.parts), start=np.zeros(())
        )
        precision = 4.0 * np.diag(whole)[:-1] / float(whole[-1, -1])
        shapes = [s for e in self.layout.equations.values() for s in e.of_shape]
        precision[: len(shapes)] += np.where(shapes, (2.0 * SHAPE_STEP) ** 2, 0.0)
        precision[len(precision) - len(self._added) :] = self._added
        return np.asarray(precision)

    # ---- candidates

    def laid(self, columns: Sequence[Mapping[str, FloatArray]], unit: Scale) -> Laid:
        """Return a candidate's columns of every run, without what the declared columns explain.

        The declared columns are those of the instrumented signals, so that a candidate does not
        profit from reading a quieter sensor.

        Args:
            columns: Equation to the columns, one mapping a run.
            unit: Which weighted norm is scaled to one, for amplitudes of one prior width.
        """
        weights, out = self.weights, [dict[Part, FloatArray]() for _ in columns]
        taken = {}
        norm: FloatArray = np.zeros(())
        for name in columns[0]:
            within, between = weights[name, "within"], weights[name, "between"]
            means = [c[name].mean(axis=0) for c in columns]
            inner = [c[name] - m for c, m in zip(columns, means, strict=True)]
            right: FloatArray = np.zeros(())
            bases = []
            for own, x, mean in zip(self._instrumented, inner, means, strict=True):
                middle = own[name].mean(axis=0)
                base = own[name] - middle
                bases.append((base, np.append(middle, 1.0)))
                part = np.vstack([base.T @ x, np.zeros((1, x.shape[1]))])
                right = right + within * part + between * np.outer(bases[-1][1], mean)
                norm = norm + within * (x * x).sum(axis=0) + between * mean * mean
            slope = taken[name] = self._projector[name] @ right
            for i, (base, middle) in enumerate(bases):
                out[i][name, "within"] = inner[i] - base @ slope[:-1]
                out[i][name, "between"] = (means[i] - middle @ slope)[None]
        each = np.sqrt(norm) + TINY
        size = {"each": each, "first": np.full_like(each, each[0]), "none": np.ones_like(each)}[
            unit
        ]
        return Laid(
            [{p: x / size for p, x in own.items()} for own in out],
            {name: slope[:-1] / size for name, slope in taken.items()},
            size,
        )

    def block(self, laid: Sequence[Laid]) -> Block:
        """Return the cross-products of candidates that have as many columns each."""
        candidates = [one.columns for one in laid]
        count, runs, k = len(laid), len(self.runs), len(laid[0].size)
        base, own, target = {}, {}, {}
        for p in self.parts:
            there = [j for j, c in enumerate(candidates) if p in c[0]]
            if not there:
                continue
            base[p] = np.zeros((runs, count, self.size, k))
            own[p] = np.zeros((runs, count, k, k))
            target[p] = np.zeros((runs, count, k))
            for r, table in enumerate(self._tables):
                columns = np.stack([candidates[j][r][p] for j in there], axis=1)
                flat = columns.reshape(len(columns), -1)
                product = (table[p].T @ flat).reshape(self.size + 1, len(there), k)
                base[p][r, there] = product[:-1].transpose(1, 0, 2)
                target[p][r, there] = product[-1]
                turned = columns.transpose(1, 2, 0)
                own[p][r, there] = turned @ turned.transpose(0, 2, 1)
        taken = np.array([self._taken_off(one) for one in laid])
        return Block(base, own, target, taken)

    def evaluate(
        self,
        block: Block,
        folds: Folds,
        precision: FloatArray,
    ) -> Outcome:
        """Fit every candidate together with the base and return its errors on what was left out.

        Args:
            block: The candidates.
            folds: Families of folds.
            precision: Prior precision of every amplitude, shape (candidates, k).
        """
        weights, there = self.weights, list(block.base)
        sums = [
            sum((weights[p] * kind[p] for p in there), start=np.zeros(()))
            for kind in (block.base, block.own, block.target)
        ]
        wholes = [s.sum(axis=0) for s in sums]

        def fitted(left_out: Sequence[int]) -> tuple[FloatArray, FloatArray]:
            inverse, alone = self._fitted(left_out)
            cross, own, right = (
                w - s[list(left_out)].sum(axis=0) if left_out else w
                for w, s in zip(wholes, sums, strict=True)
            )
            through = np.matmul(inverse, cross)
            eye = np.eye(own.shape[1])
            spread = 1e-9 * np.einsum("ckk->ck", own) + precision
            schur = own - np.matmul(cross.transpose(0, 2, 1), through) + spread[:, :, None] * eye
            left = right - np.einsum("cik,i->ck", cross, alone)
            amplitudes = np.linalg.solve(schur, left[..., None])[..., 0]
            return alone - np.einsum("cik,ck->ci", through, amplitudes), amplitudes

        errors = []
        for family in folds:
            found = {p: np.zeros((len(self.runs), len(precision))) for p in self.parts}
            for left_out in family:
                base, amplitudes = fitted(list(left_out))
                for p in self.parts:
                    for i in left_out:
                        found[p][i] = self._squared(block, p, i, base, amplitudes)
            errors.append(found)
        base, amplitudes = fitted([])
        inside, usual = [p for p in there if p[1] == "within"], self._fitted()[1]
        cross, own, right = (
            sum((weights[p] * kind[p] for p in inside), start=np.zeros(()))
            for kind in (block.base, block.own, block.target)
        )
        return Outcome(
            errors, amplitudes, base, right - np.einsum("rcik,i->rck", cross, usual), own
        )

    def _squared(
        self, block: Block, p: Part, run: int, base: FloatArray, amplitudes: FloatArray
    ) -> FloatArray:
        gram = self._gram[p][run]
        error = gram[-1, -1] - 2 * base @ gram[:-1, -1] + ((base @ gram[:-1, :-1]) * base).sum(1)
        if p in block.base:
            cross = np.einsum("ci,cik,ck->c", base, block.base[p][run], amplitudes)
            own = np.einsum("ck,ckl,cl->c", amplitudes, block.own[p][run], amplitudes)
            error = error + 2 * cross + own - 2 * (amplitudes * block.target[p][run]).sum(1)
        declared = self._whole(base) - np.einsum("cdk,ck->cd", block.taken, amplitudes)
        return np.asarray(np.maximum(error, 0.0) + self._avoided(p, run, declared))

    def replaces(self, laid: Laid, base: FloatArray, amplitudes: FloatArray) -> bool:
        """Whether a cause stands in for the largest linear term of an equation.

        A reading of the target through another sensor explains any equation, with no use for the
        declared terms. A cause comes in addition to them.

        Args:
            laid: The cause.
            base: Parameters of the base next to it, shape (base,).
            amplitudes: Of the cause, shape (k,).
        """
        now = self._whole(base) - self._taken_off(laid) @ amplitudes
        at = 0
        for equation in self.layout.equations.values():
            linear = at + np.flatnonzero(equation.of_channel)
            at += len(equation.of_channel)
            if equation.name not in laid.taken or not len(linear):
                continue
            power = np.diag(self._gram[equation.name, "within"].sum(axis=0))[linear]
            largest = linear[int(np.argmax(self._declared[linear] ** 2 * power))]
            change = float(now[largest] / (self._declared[largest] or 1.0))
            if not 1.0 / MOST_CHANGE < change < MOST_CHANGE:
                return True
        return False

    def base_errors(self, folds: Folds) -> Sequence[Mapping[Part, FloatArray]]:
        """Return the squared errors of the base on what was left out, one mapping a family."""
        out: list[Mapping[Part, FloatArray]] = []
        for family in folds:
            found = {p: np.zeros(len(self.runs)) for p in self.parts}
            for left_out in family:
                vector = np.append(self._fitted(left_out)[1], -1.0)
                for p in self.parts:
                    for i in left_out:
                        value = max(float(vector @ self._gram[p][i] @ vector), 0.0)
                        found[p][i] = value + float(self._avoided(p, i, self._whole(vector[:-1])))
            out.append(found)
        return out

    def score(
        self,
        spreads: Sequence[Mapping[Part, float]],
        before: Sequence[Mapping[Part, FloatArray]],
        after: Sequence[Mapping[Part, FloatArray]],
    ) -> tuple[FloatArray, FloatArray]:
        """Return scores of candidates, and those of each family of folds, (families, candidates).

        The score of a part is the mean over families. A family counts by how well the base itself
        is known where it predicts, and at most what the family of single runs shows: where the base
        extrapolates badly anything seems to help.

        Args:
            spreads: `extrapolated` of each family of folds.
            before: Errors of the base, of each family.
            after: Errors with the candidates.
        """
        total, by_family = np.zeros(()), [np.zeros(()) for _ in spreads]
        for p in self.parts:
            ratios, trusts = [], []
            for spread, old, new in zip(spreads, before, after, strict=True):
                pair = [(e[p].sum(axis=0) + spread[p]) / self.samples[p].sum() for e in (old, new)]
                ratios.append(self.log_ratio(p, pair[0], pair[1]))
                whole = float(old[p].sum()) + TINY
                trusts.append(whole / (whole + spread[p]))
            least = [t * np.minimum(r, ratios[0]) for t, r in zip(trusts, ratios, strict=True)]
            total = total + np.sum(least, axis=0) / sum(trusts)
            by_family = [f + r for f, r in zip(by_family, ratios, strict=True)]
        return np.asarray(total), np.array(by_family)

    def extrapolated(self, family: Sequence[Sequence[int]]) -> Mapping[Part, float]:
        """Return the squared error that the base's own uncertainty makes in what was left out."""
        out = dict.fromkeys(self.parts, 0.0)
        for left_out in family:
            inverse, _ = self._fitted(left_out)
            for p in self.parts:
                for i in left_out:
                    out[p] += float(np.sum(self._gram[p][i][:-1, :-1] * inverse))
        return out

    def log_ratio(self, part: Part, before: FloatArray, after: FloatArray) -> FloatArray:
        """Return the weighted log ratio of mean squared errors of a part, above its floor."""
        numbers, weight = self.numbers, 1.0
        floor = numbers.form_floor * self.error[part]
        if part[1] == "between":
            weight = numbers.between
            floor += numbers.between * self.error[part[0], "within"]
        return np.asarray(weight * np.log((before + floor) / (after + floor)))

    # ---- accepted causes

    def with_cause(self, laid: Laid, precision: FloatArray) -> "Joint":
        """Return the regression with a cause's columns, of a prior precision each, in its base."""
        made = object.__new__(Joint)
        made.__dict__.update(self.__dict__)
        made._added = np.append(self._added, precision)
        made._taken = np.hstack([self._taken, self._taken_off(laid)])
        k = len(laid.size)
        made._tables = []
        for table, columns in zip(self._tables, laid.columns, strict=True):
            grown = {}
            for p in self.parts:
                added = columns.get(p, np.zeros((len(table[p]), k)))
                grown[p] = np.hstack([table[p][:, :-1], added, table[p][:, -1:]])
            made._tables.append(grown)
        made._gram = made._products()
        made._prepare()
        return made


def _first(run: RunSignals) -> Mapping[str, FloatArray]:
    return {name: values[:8] for name, values in run.channels.items()}


def _at_most(noise: FloatArray, gram: FloatArray) -> FloatArray:
    """Return noise products of columns and target, less than the columns' own in any direction."""
    scale = _scales(gram[:-1, :-1])
    inner = gram[:-1, :-1] * np.outer(scale, scale) + 1e-8 * np.eye(len(scale))
    root = np.linalg.cholesky(inner)
    turned = np.linalg.solve(root, noise[:-1, :-1] * np.outer(scale, scale))
    share, axes = np.linalg.eigh(np.linalg.solve(root, turned.T))
    kept = root @ (axes * np.clip(share, 0.0, 1.0)) @ axes.T @ root.T
    out = noise.copy()
    out[:-1, :-1] = kept / np.outer(scale, scale)
    return out


def _scales(gram: FloatArray) -> FloatArray:
    return np.asarray(1.0 / np.sqrt(np.diag(gram) + TINY))


def _inverse(gram: FloatArray) -> FloatArray:
    scale = _scales(gram)
    inner = gram * np.outer(scale, scale) + 1e-8 * np.eye(len(gram))
    return np.asarray(np.linalg.inv(inner) * np.outer(scale, scale))
