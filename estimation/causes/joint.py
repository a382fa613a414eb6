"""All equations as one regression, cross-validated over runs and over levels of the conditions.

The declared parameters, an offset of each equation and the amplitudes of every cause are one
vector. Each equation has two residuals: within runs, and of the runs' means. Everything that a
score needs is in cross-products of one run, worked out once, so a fold costs one small solve.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from estimation.causes.equations import Layout, RunSignals
from estimation.causes.folds import Folds
from estimation.causes.instruments import signal
from estimation.causes.numbers import DEFAULT, Numbers
from estimation.recording import FloatArray

Part = tuple[str, str]
"""An equation and `within` runs or `between` them."""

Columns = Mapping[Part, FloatArray]

TINY = 1e-300

MOST_NOISE = 0.95
"""Share of a run's signal in any direction that may be noise."""


@dataclass(frozen=True)
class Block:
    """Cross-products of candidates with as many columns each, run by run.

    Attributes:
        base: Part to candidates' columns times the base's, shape (runs, candidates, base, k).
        own: Part to candidates' columns times themselves, shape (runs, candidates, k, k).
        target: Part to candidates' columns times the target, shape (runs, candidates, k).
    """

    base: Mapping[Part, FloatArray]
    own: Mapping[Part, FloatArray]
    target: Mapping[Part, FloatArray]


@dataclass(frozen=True)
class Outcome:
    """Candidates of one block, fitted and left out.

    Attributes:
        errors: For each family of folds, part to squared error, shape (runs, candidates).
        amplitudes: On all runs, shape (candidates, k).
        base: Parameters of the base on all runs, shape (candidates, base).
    """

    errors: Sequence[Mapping[Part, FloatArray]]
    amplitudes: FloatArray
    base: FloatArray


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
        self._gram = self._products()
        self._gram, self.error = self._without_noise()
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

    def _without_noise(self) -> tuple[Mapping[Part, FloatArray], Mapping[Part, float]]:
        """Return cross-products without the noise of the declared columns, and declared errors.

        Corrected least squares: noise of a regressor would shrink its amplitude, and whatever
        stands in for that regressor with less noise would then remove error. The noise of the
        declared fit is put back as a constant, so errors remain those of the declared equations.
        """
        raw, noise = self._gram, self._noise_products()
        clean = {p: raw[p] - noise[p] if p in noise else raw[p] for p in self.parts}
        error, self._gram, count = dict.fromkeys(self.parts, 1.0), clean, len(self.runs)
        for _ in range(5):
            self.error = error
            vector = np.append(_solved(self._weighted()), -1.0)
            for p in self.parts:
                value = float(np.einsum("i,rij,j->", vector, raw[p], vector))
                spare = count / max(1, count - 3) if p[1] == "between" else 1.0
                error[p] = max(spare * value / self.samples[p].sum(), TINY)
        for p, made in noise.items():
            clean[p][:, -1, -1] += np.einsum("i,rij,j->r", vector, made, vector)
        return clean, error

    def _noise_products(self) -> Mapping[Part, FloatArray]:
        """Return the noise in the cross-products within runs; the target's own is left in."""
        out, equations = {}, list(self.layout.equations.values())
        at, size = 0, self.size + 1
        for equation in equations:
            part = (equation.name, "within")
            made = np.zeros((len(self.runs), size, size))
            for r, run in enumerate(self.runs):
                noise = equation.noise(run)[run.grid[run.used[equation.name]]]
                width = noise.shape[1] - 1
                own = [*range(at, at + width), size - 1]
                product = noise.T @ noise
                product[-1, -1] = 0.0
                made[r][np.ix_(own, own)] = _at_most(product, self._gram[part][r][np.ix_(own, own)])
            out[part] = made
            at += width
        return out

    def _weighted(self, left_out: Sequence[int] = ()) -> FloatArray:
        kept = [i for i in range(len(self.runs)) if i not in set(left_out)]
        weights = self.weights
        total: FloatArray = sum(
            (weights[p] * self._gram[p][kept].sum(axis=0) for p in self.parts),
            start=np.zeros(()),
        )
        return total

    # ---- candidates

    def laid(self, columns: Sequence[Mapping[str, FloatArray]], unit: bool) -> list[Columns]:
        """Return a candidate's columns of every run, without what the declared columns explain.

        The declared columns are those of the instrumented signals, so that a candidate does not
        profit from reading a quieter sensor.

        Args:
            columns: Equation to the columns, one mapping a run.
            unit: Scale each column to weighted norm one, for amplitudes of one prior width.
        """
        weights, out = self.weights, [dict[Part, FloatArray]() for _ in columns]
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
            slope = self._projector[name] @ right
            for i, (base, middle) in enumerate(bases):
                out[i][name, "within"] = inner[i] - base @ slope[:-1]
                out[i][name, "between"] = (means[i] - middle @ slope)[None]
        if not unit:
            return list(out)
        size = np.sqrt(norm) + TINY
        return [{p: values / size for p, values in own.items()} for own in out]

    def block(self, candidates: Sequence[Sequence[Columns]]) -> Block:
        """Return the cross-products of candidates that have as many columns each."""
        count, runs = len(candidates), len(self.runs)
        k = next(iter(candidates[0][0].values())).shape[1]
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
        return Block(base, own, target)

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
        whole = self._weighted()

        def fitted(left_out: Sequence[int]) -> tuple[FloatArray, FloatArray]:
            gram = self._weighted(left_out) if left_out else whole
            cross, own, right = (
                w - s[list(left_out)].sum(axis=0) if left_out else w
                for w, s in zip(wholes, sums, strict=True)
            )
            inverse = _inverse(gram[:-1, :-1])
            alone = inverse @ gram[:-1, -1]
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
        return Outcome(errors, amplitudes, base)

    def _squared(
        self, block: Block, p: Part, run: int, base: FloatArray, amplitudes: FloatArray
    ) -> FloatArray:
        gram = self._gram[p][run]
        error = gram[-1, -1] - 2 * base @ gram[:-1, -1] + ((base @ gram[:-1, :-1]) * base).sum(1)
        if p in block.base:
            cross = np.einsum("ci,cik,ck->c", base, block.base[p][run], amplitudes)
            own = np.einsum("ck,ckl,cl->c", amplitudes, block.own[p][run], amplitudes)
            error = error + 2 * cross + own - 2 * (amplitudes * block.target[p][run]).sum(1)
        return np.asarray(np.maximum(error, 0.0))

    def base_errors(self, folds: Folds) -> Sequence[Mapping[Part, FloatArray]]:
        """Return the squared errors of the base on what was left out, one mapping a family."""
        out: list[Mapping[Part, FloatArray]] = []
        for family in folds:
            found = {p: np.zeros(len(self.runs)) for p in self.parts}
            for left_out in family:
                vector = np.append(_solved(self._weighted(list(left_out))), -1.0)
                for p in self.parts:
                    for i in left_out:
                        found[p][i] = max(float(vector @ self._gram[p][i] @ vector), 0.0)
            out.append(found)
        return out

    def score(
        self,
        folds: Folds,
        before: Sequence[Mapping[Part, FloatArray]],
        after: Sequence[Mapping[Part, FloatArray]],
    ) -> FloatArray:
        """Return the log ratio of errors, summed over parts, shape (families, candidates)."""
        rows = []
        for family, old, new in zip(folds, before, after, strict=True):
            spread = self._extrapolated(family)
            means = [
                {p: (e[p].sum(axis=0) + spread[p]) / self.samples[p].sum() for p in self.parts}
                for e in (old, new)
            ]
            rows.append(self.log_ratio(means[0], means[1]))
        return np.array(rows)

    def _extrapolated(self, family: Sequence[Sequence[int]]) -> Mapping[Part, float]:
        """Return the squared error that the base's own uncertainty makes in what was left out."""
        out = dict.fromkeys(self.parts, 0.0)
        for left_out in family:
            inverse = _inverse(self._weighted(list(left_out))[:-1, :-1])
            for p in self.parts:
                for i in left_out:
                    out[p] += float(np.sum(self._gram[p][i][:-1, :-1] * inverse))
        return out

    def log_ratio(
        self, before: Mapping[Part, FloatArray], after: Mapping[Part, FloatArray]
    ) -> FloatArray:
        """Return the log ratio of mean squared errors, summed over parts, above their floors."""
        numbers, total = self.numbers, np.zeros(())
        for p in self.parts:
            floor, weight = numbers.form_floor * self.error[p], 1.0
            if p[1] == "between":
                weight = numbers.between_weight
                floor += numbers.between_floor * self.error[p[0], "within"]
            total = total + weight * np.log((before[p] + floor) / (after[p] + floor))
        return np.asarray(total)

    # ---- accepted causes

    def with_cause(self, columns: Sequence[Columns]) -> "Joint":
        """Return the regression with a cause's columns in its base."""
        made = object.__new__(Joint)
        made.__dict__.update(self.__dict__)
        k = next(iter(columns[0].values())).shape[1]
        made._tables = []
        for i, table in enumerate(self._tables):
            grown = {}
            for p in self.parts:
                added = columns[i].get(p, np.zeros((len(table[p]), k)))
                grown[p] = np.hstack([table[p][:, :-1], added, table[p][:, -1:]])
            made._tables.append(grown)
        made._gram = made._grown(self._gram)
        return made

    def _grown(self, known: Mapping[Part, FloatArray]) -> Mapping[Part, FloatArray]:
        """Return cross-products with those of the last columns added; known ones are kept."""
        out, fresh = {}, self._products()
        for p, raw in fresh.items():
            old = [*range(known[p].shape[1] - 1), -1]
            raw[np.ix_(range(len(raw)), old, old)] = known[p]
            out[p] = raw
        return out


def _first(run: RunSignals) -> Mapping[str, FloatArray]:
    return {name: values[:8] for name, values in run.channels.items()}


def _at_most(noise: FloatArray, gram: FloatArray) -> FloatArray:
    """Return noise products of columns and target, less than the columns' own in any direction."""
    scale = _scales(gram[:-1, :-1])
    inner = gram[:-1, :-1] * np.outer(scale, scale) + 1e-8 * np.eye(len(scale))
    root = np.linalg.cholesky(inner)
    turned = np.linalg.solve(root, noise[:-1, :-1] * np.outer(scale, scale))
    share, axes = np.linalg.eigh(np.linalg.solve(root, turned.T))
    kept = root @ (axes * np.clip(share, 0.0, MOST_NOISE)) @ axes.T @ root.T
    out = noise.copy()
    out[:-1, :-1] = kept / np.outer(scale, scale)
    return out


def _scales(gram: FloatArray) -> FloatArray:
    return np.asarray(1.0 / np.sqrt(np.diag(gram) + TINY))


def _inverse(gram: FloatArray) -> FloatArray:
    scale = _scales(gram)
    inner = gram * np.outer(scale, scale) + 1e-8 * np.eye(len(gram))
    return np.asarray(np.linalg.inv(inner) * np.outer(scale, scale))


def _solved(gram: FloatArray) -> FloatArray:
    """Solve a Gram matrix of columns and target."""
    return np.asarray(_inverse(gram[:-1, :-1]) @ gram[:-1, -1])
