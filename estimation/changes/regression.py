"""All equations of two campaigns as one regression, kept as cross-products of each run.

Each run has two parts in every equation: its samples with their mean removed, and that mean. Parts
are weighted by the residual variance of the declared model; the samples of one run count as
`SAMPLES_A_RUN` independent ones. A change acts on some of the runs only, so with the cross-products
of each run at hand its gain for any choice of runs is a sum.

A column that is a noisy reading would get too small an amplitude. Noise rows, one realisation of
the sensors' noise in the same columns, are subtracted from the cross-products as in the diagnosis.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from estimation.causes.equations import Equation, Layout, RunSignals
from estimation.recording import FloatArray

SAMPLES_A_RUN = 40.0
"""Independent samples that a run is worth, as in the diagnosis."""

LEAST_SHARE = 1e-8
"""Share of a column below which its residual on the others counts as none: the same column."""

NOISE_TAKEN = 0.8
"""Share of the known noise that is subtracted, as in the diagnosis."""

TINY = 1e-300

Columns = Mapping[str, FloatArray]
"""Equation to columns at the samples that it counts, (n, k)."""


@dataclass(frozen=True)
class Products:
    """Cross-products of a candidate's k columns with the base and the target, run by run.

    Attributes:
        cross: Shape (runs, base + 1, k); the last row is with the target.
        own: Shape (runs, k, k).
    """

    cross: FloatArray
    own: FloatArray


@dataclass(frozen=True, eq=False)
class Laid:
    """A candidate's weighted rows in every run, (rows, k) each, and those of its noise."""

    rows: Sequence[FloatArray]
    noise: Sequence[FloatArray]


class Regression:
    """The declared columns of every run, and changes that were accepted.

    Attributes:
        tables: Weighted columns and target of each run, shape (rows, base + 1) each.
        labels: Equation and number of each declared column; None for an offset.
    """

    def __init__(self, layout: Layout) -> None:
        self.layout = layout
        self._sizes = {e: [len(run.used[e]) for run in layout.runs] for e in layout.equations}
        declared = [
            {e: declared_columns(q, run) for e, q in layout.equations.items()}
            for run in layout.runs
        ]
        self.widths = {e: declared[0][e].shape[1] for e in layout.equations}
        # at first a mean counts as the samples do: a column that barely varies within runs has its
        # amplitude from the means, and the weights below would otherwise never find that out
        self._weights = dict.fromkeys(layout.equations, (1.0, SAMPLES_A_RUN))
        noise = [
            {e: _amplitudes_of(q, q.noise(run), run) for e, q in layout.equations.items()}
            for run in layout.runs
        ]
        targets = [
            {e: run.on_grid(q.target)[run.used[e], None] for e, q in layout.equations.items()}
            for run in layout.runs
        ]
        for _ in range(4):
            self.tables = [
                np.hstack([self._declared(d), self.rows(t).sum(axis=1, keepdims=True)])
                for d, t in zip(declared, targets, strict=True)
            ]
            self.noise = [self._noise_rows(n, t) for n, t in zip(noise, self.tables, strict=True)]
            self._reweigh()

    @property
    def size(self) -> int:
        """Columns of the base."""
        return int(self.tables[0].shape[1]) - 1

    def _declared(self, columns: Columns) -> FloatArray:
        """Return the declared columns, one block an equation, then one offset of each equation."""
        blocks = self.rows(columns)
        ones = self.rows({e: np.ones((len(columns[e]), 1)) for e in columns})
        return np.hstack([blocks, ones])

    def _noise_rows(self, noise: Columns, table: FloatArray) -> FloatArray:
        """Return a run's noise in the columns of its table, none larger than the column itself."""
        blocks = self.rows({e: values[:, :-1] for e, values in noise.items()})
        target = self.rows({e: values[:, -1:] for e, values in noise.items()})
        offsets = np.zeros((len(blocks), len(noise)))
        out = np.hstack([blocks, offsets, target.sum(axis=1, keepdims=True)])
        size, most = np.square(out).sum(axis=0), np.square(table).sum(axis=0)
        return np.asarray(out * np.sqrt(most / np.maximum(np.maximum(size, most), TINY)))

    def rows(self, columns: Columns) -> FloatArray:
        """Return weighted rows of some equations, a block of columns an equation."""
        parts = []
        for equation in self.layout.equations:
            if equation not in columns:
                continue
            own = columns[equation]
            mean = own.mean(axis=0)
            within, between = self._weights[equation]
            scale = np.sqrt(SAMPLES_A_RUN * within / len(own))
            parts.append((equation, np.vstack([scale * (own - mean), np.sqrt(between) * mean])))
        width = sum(part.shape[1] for _, part in parts)
        heights = {e: 1 + len(columns[e]) for e in columns}
        total = sum(heights[e] for e in self.layout.equations if e in heights)
        out, row, column = np.zeros((total, width)), 0, 0
        for equation, part in parts:
            out[row : row + heights[equation], column : column + part.shape[1]] = part
            row, column = row + heights[equation], column + part.shape[1]
        return out

    def candidate_rows(self, columns: Columns, run: int) -> FloatArray:
        """Return a cause's weighted rows in one run: the same columns in every equation."""
        k = next(iter(columns.values())).shape[1]
        out = np.zeros((len(self.tables[run]), k))
        for equation, own in columns.items():
            inside = self._rows_of(equation, run)
            within, between = self._weights[equation]
            mean = own.mean(axis=0)
            out[inside] = np.sqrt(SAMPLES_A_RUN * within / len(own)) * (own - mean)
            out[inside.stop] = np.sqrt(between) * mean
        return out

    def _reweigh(self) -> None:
        """Set each part's weight to one over the residual variance of the declared model."""
        self.__dict__.pop("_grams", None)
        gram = self.gram()
        vector = np.append(solved(gram), -1.0)
        weights = {}
        for equation in self.layout.equations:
            inner, means = 0.0, []
            for run, table in enumerate(self.tables):
                inside = self._rows_of(equation, run)
                rest = table[inside] @ vector
                inner += float(rest @ rest)
                means.append(float(table[inside.stop] @ vector))
            within, between = self._weights[equation]
            count = len(self.tables)
            spare = max(1, count - 3)
            variance = inner / (SAMPLES_A_RUN * within * count)
            between_variance = float(np.square(means).sum()) / (between * spare)
            # where the means of runs agree by chance they are not worth more than the samples
            floor = variance / SAMPLES_A_RUN
            weights[equation] = (1 / max(variance, TINY), 1 / max(between_variance, floor, TINY))
        self._weights = weights

    def _rows_of(self, equation: str, run: int) -> slice:
        """Return the rows of an equation's samples in a run's table; its mean is the one after."""
        names = list(self._sizes)
        start = sum(self._sizes[e][run] + 1 for e in names[: names.index(equation)])
        return slice(start, start + self._sizes[equation][run])

    def rms(self, equation: str, parameters: FloatArray, counts: FloatArray) -> float:
        """Return an equation's root mean square error within runs, in the unit of its target."""
        vector = np.append(parameters, -1.0)
        within, _ = self._weights[equation]
        squares = total = 0.0
        for run, table in enumerate(self.tables):
            rest = table[self._rows_of(equation, run)] @ vector
            squares += counts[run] * float(rest @ rest) / (SAMPLES_A_RUN * within)
            total += counts[run]
        return float(np.sqrt(squares / max(total, TINY)))

    def declared_column(self, equation: str, column: int) -> int:
        """Return the number of an equation's declared column among the base's; -1 is the offset."""
        names = list(self.layout.equations)
        if column < 0:
            return int(sum(self.widths.values())) + names.index(equation)
        return int(sum(self.widths[e] for e in names[: names.index(equation)])) + column

    def size_of(self, equation: str, column: int) -> float:
        """Return the root mean square of a declared column over that of the target, all runs."""
        inside = [self._rows_of(equation, run) for run in range(len(self.tables))]
        own = self.declared_column(equation, column)
        squares = [
            sum(
                float(np.square(t[rows, k]).sum())
                for t, rows in zip(self.tables, inside, strict=True)
            )
            for k in (own, -1)
        ]
        return float(np.sqrt(squares[0] / max(squares[1], TINY)))

    def gram(self, weights: FloatArray | None = None) -> FloatArray:
        """Return the cross-products of base and target, each run counted so many times."""
        if weights is None:
            return np.asarray(self._grams.sum(axis=0))
        return np.asarray(np.einsum("r,rpq->pq", weights, self._grams))

    @cached_property
    def _grams(self) -> FloatArray:
        grams = np.array([t.T @ t for t in self.tables])
        noise = NOISE_TAKEN * np.array([n.T @ n for n in self.noise])
        noise[:, -1, -1] = 0.0
        return np.asarray(grams - noise)

    def laid(self, columns: Sequence[Columns], declared: int | None = None) -> Laid:
        """Return a candidate's rows in every run.

        Args:
            columns: Its columns in every run.
            declared: The column of the base that it is, with that column's noise; None for another.
        """
        rows = [self.candidate_rows(c, k) for k, c in enumerate(columns)]
        if declared is None:
            return Laid(rows, [np.zeros_like(z) for z in rows])
        return Laid(rows, [n[:, [declared]] for n in self.noise])

    def products(self, laid: Laid) -> Products:
        """Return the cross-products of a candidate in every run."""
        cross = np.array([t.T @ z for t, z in zip(self.tables, laid.rows, strict=True)])
        own = np.array([z.T @ z for z in laid.rows])
        cross -= NOISE_TAKEN * np.array(
            [n.T @ z for n, z in zip(self.noise, laid.noise, strict=True)]
        )
        return Products(cross, own - NOISE_TAKEN * np.array([z.T @ z for z in laid.noise]))

    def grown(self, laid: Laid, acts: FloatArray) -> "Regression":
        """Return the regression with a change in its base.

        Args:
            laid: The change's rows in every run.
            acts: 1 for runs in which it acts, else 0.
        """
        made = object.__new__(Regression)
        made.__dict__.update(self.__dict__)
        made.__dict__.pop("_grams", None)
        made.tables = _with_column(self.tables, laid.rows, acts)
        made.noise = _with_column(self.noise, laid.noise, acts)
        return made


def declared_columns(equation: Equation, run: RunSignals) -> FloatArray:
    """Return an equation's columns at the samples it counts; shapes keep their fitted values."""
    return _amplitudes_of(equation, equation.columns(run.channels), run)


def _amplitudes_of(equation: Equation, columns: FloatArray, run: RunSignals) -> FloatArray:
    kept = [
        k
        for k in range(columns.shape[1])
        if k >= len(equation.of_shape) or not equation.of_shape[k]
    ]
    return np.asarray(columns[run.grid[run.used[equation.name]]][:, kept])


def _with_column(
    tables: Sequence[FloatArray], columns: Sequence[FloatArray], acts: FloatArray
) -> list[FloatArray]:
    """Return tables with columns before their last one, in the runs in which they act."""
    return [
        np.hstack([t[:, :-1], on * z, t[:, -1:]])
        for t, z, on in zip(tables, columns, acts, strict=True)
    ]


def solved(gram: FloatArray) -> FloatArray:
    """Return the least-squares parameters of a Gram matrix whose last column is the target."""
    return np.asarray(inverse(gram[:-1, :-1]) @ gram[:-1, -1])


def squared_error(gram: FloatArray) -> float:
    """Return the weighted squared error of a Gram matrix whose last column is the target."""
    return max(float(gram[-1, -1] - gram[-1, :-1] @ solved(gram)), TINY)


def inverse(gram: FloatArray) -> FloatArray:
    """Return the inverse of a Gram matrix, columns scaled, collinear ones kept finite."""
    size = np.sqrt(np.diag(gram))
    scale = np.where(size > 0.0, 1.0 / np.where(size > 0.0, size, 1.0), 0.0)
    inner = gram * np.outer(scale, scale) + 1e-9 * np.eye(len(gram))
    return np.asarray(np.linalg.inv(inner) * np.outer(scale, scale))


def gains(
    gram: FloatArray, products: Products, acts: FloatArray, counts: FloatArray | None = None
) -> tuple[FloatArray, FloatArray]:
    """Return how much a candidate that acts in some runs lowers the squared error.

    Args:
        gram: Of base and target, runs counted as `counts`.
        products: The candidate's.
        acts: Runs in which it acts, one row a choice, shape (choices, runs).
        counts: How often each run counts, or None for once.

    Returns:
        Logarithm of the squared error before over after, shape (choices,), and the amplitudes,
        shape (choices, k).
    """
    weights = acts if counts is None else acts * counts
    cross = np.einsum("mr,rpk->mpk", weights, products.cross)
    own = np.einsum("mr,rkl->mkl", weights, products.own)
    turned = inverse(gram[:-1, :-1])
    parameters = turned @ gram[:-1, -1]
    before = max(float(gram[-1, -1] - gram[-1, :-1] @ parameters), TINY)
    base = cross[:, :-1]
    left = own - np.einsum("mpk,pq,mql->mkl", base, turned, base)
    k = own.shape[-1]
    diagonal = np.einsum("mkk->mk", own)
    alike = np.einsum("mkk->mk", left) < LEAST_SHARE * diagonal + TINY
    left = left + (LEAST_SHARE * diagonal + TINY)[:, :, None] * np.eye(k)
    right = cross[:, -1] - np.einsum("mpk,p->mk", base, parameters)
    amplitudes = np.linalg.solve(left, right[..., None])[..., 0]
    gain = np.einsum("mk,mk->m", amplitudes, right)
    gain = np.where(alike.any(axis=1), 0.0, np.clip(gain, 0.0, before * (1 - 1e-12)))
    return -np.log1p(-gain / before), amplitudes
