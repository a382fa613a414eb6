"""Candidate causes laid out on the runs, without what the declared columns explain."""

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from estimation.recording import FloatArray

Columns = NDArray[np.floating[Any]]
"""Columns of causes; of 32 bits within runs: there are thousands, and the noise is far larger."""

Part = tuple[str, str]
"""An equation and `within` runs or `between` them."""

Scale = Literal["each", "first", "none"]
"""Of which columns the norm is one: of each, of the first, or of none."""

TINY = 1e-300

NOTHING = 1e-12
"""Norm of a column, in declared errors of its equations for one unit, below which it is zero."""


Chosen = slice | NDArray[np.intp] | NDArray[np.bool_]


@dataclass(frozen=True)
class Followed:
    """Products of the noise of readings that causes follow.

    Attributes:
        across: Equation to those with the noise of the declared columns and, last, of the target:
            shape (runs, causes, declared + 1, k).
        own: Equation to those with itself, shape (runs, causes, k, k).
    """

    across: Mapping[str, FloatArray]
    own: Mapping[str, FloatArray]

    def only(self, chosen: Chosen) -> "Followed":
        """Return those of some of the causes."""
        parts = (self.across, self.own)
        return Followed(*({name: x[:, chosen] for name, x in part.items()} for part in parts))


@dataclass(frozen=True)
class Laid:
    """Causes that enter the same equations, with as many columns each.

    Attributes:
        inner: Equation to the columns less each run's mean, shape (runs, causes, samples, k); zero
            after a run's last sample.
        means: Equation to the runs' means, shape (runs, causes, k).
        taken: Equation to how much of each declared column was taken off, (causes, declared, k).
        size: What the columns were divided by, shape (causes, k).
        followed: The noise that the columns follow.
    """

    inner: Mapping[str, Columns]
    means: Mapping[str, FloatArray]
    taken: Mapping[str, FloatArray]
    size: FloatArray
    followed: Followed

    def __len__(self) -> int:
        return len(self.size)

    def part(self, part: Part) -> Columns | None:
        """Return the columns of a part, (runs, causes, samples, k); None where there are none."""
        name, kind = part
        if name not in self.inner:
            return None
        return self.inner[name] if kind == "within" else self.means[name][:, :, None]

    def only(self, chosen: Chosen) -> "Laid":
        """Return some of the causes."""
        return Laid(
            {name: x[:, chosen] for name, x in self.inner.items()},
            {name: x[:, chosen] for name, x in self.means.items()},
            {name: x[chosen] for name, x in self.taken.items()},
            self.size[chosen],
            self.followed.only(chosen),
        )

    def within(self, equations: Container[str]) -> "Laid":
        """Return the same causes as if they entered some of the equations only."""
        inner = {name: x for name, x in self.inner.items() if name in equations}
        parts = (self.means, self.taken, self.followed.across, self.followed.own)
        kept = [{name: x for name, x in part.items() if name in equations} for part in parts]
        means, taken, across, own = kept
        return Laid(inner, means, taken, self.size, Followed(across, own))


def centred(columns: Sequence[FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Return columns of every run, (n, k) each, less each run's mean, and the means, (runs, k).

    The runs are in one array that zeros fill up, (runs, samples, k).
    """
    counts = np.array([len(own) for own in columns])
    out = np.zeros((len(counts), counts.max(), columns[0].shape[1]))
    for inner, own in zip(out, columns, strict=True):
        inner[: len(own)] = own
    means = out.sum(axis=1) / counts[:, None]
    for inner, mean, count in zip(out, means, counts, strict=True):
        inner[:count] -= mean
    return out, means


class Projection:
    """What the declared columns explain, read from the sensors that the equation does not use.

    A candidate does not profit from reading a quieter sensor.

    Args:
        declared: Equation to the declared columns of instrumented signals, of every run.
        noise: Equation to the noise of the declared columns and of the target, of every run.
        instead: Equation to the noise of the columns of instrumented signals less that of the
            declared ones, of every run; of equations without an instrument it may lack.
        weights: Equation to the weights of one squared residual within runs and between them.
        precision: Equation to the prior precision of each declared parameter. The derivative by the
            shape of a term that is as good as zero would explain anything without it.
    """

    def __init__(
        self,
        declared: Mapping[str, Sequence[FloatArray]],
        noise: Mapping[str, FloatArray],
        instead: Mapping[str, FloatArray],
        weights: Mapping[str, tuple[float, float]],
        precision: Mapping[str, FloatArray],
    ) -> None:
        self.weights = weights
        self._instead = {name: x.astype(np.float32) for name, x in instead.items()}
        self._inner, self._means, self._inverse = dict[str, Columns](), {}, {}
        self._noise = {name: x.astype(np.float32) for name, x in noise.items()}
        for name, columns in declared.items():
            inner, means = centred(columns)
            means = np.column_stack([means, np.ones(len(means))])
            within, between = weights[name]
            gram = between * means.T @ means
            gram[:-1, :-1] += within * np.tensordot(inner, inner, ([0, 1], [0, 1]))
            gram[:-1, :-1] += np.diag(precision[name])
            self._inner[name], self._means[name] = inner.astype(np.float32), means
            self._inverse[name] = inverse(gram)

    def laid(
        self,
        columns: Mapping[str, tuple[Columns, FloatArray]],
        followed: Mapping[str, Columns],
        unit: Scale,
        has_means: bool = True,
    ) -> Laid:
        """Return causes without what the declared columns explain.

        Args:
            columns: Equation to the causes' columns less each run's mean, shape
                (runs, causes, samples, k), changed in place, and the means, (runs, causes, k).
            followed: Equation to the noise of readings that the columns follow, changed in place.
            unit: Which weighted norm is scaled to one, for amplitudes of one prior width.
            has_means: Whether the causes have an effect on the means of runs.
        """
        inners, middles, taken = {}, {}, {}
        norm: FloatArray = np.zeros(())
        for name, (inner, means) in columns.items():
            within, between = self.weights[name]
            if not has_means:
                means = np.zeros_like(means)
            if unit != "none":
                norm = norm + within * np.einsum("rcnk,rcnk->ck", inner, inner)
                norm = norm + between * np.einsum("rck,rck->ck", means, means)
            base, middle = self._inner[name], self._means[name]
            right = between * np.einsum("ri,rck->cik", middle, means)
            right[:, :-1] += within * products(base[:, None], inner).sum(axis=0)
            slope = self._inverse[name] @ right
            inner -= times(base[:, None], slope[None, :, :-1].astype(np.float32))
            inners[name], taken[name] = inner, slope[:, :-1]
            middles[name] = means - np.einsum("ri,cik->rck", middle, slope)
        size = np.ones(next(iter(middles.values())).shape[1:])
        if unit != "none":
            size = np.sqrt(norm) + TINY
            if unit == "first":
                size = np.repeat(size[:, :1], size.shape[1], axis=1)
            for name, inner in inners.items():
                inner /= size[:, None]
                middles[name] /= size
                taken[name] = taken[name] / size[:, None]
        for noise in followed.values():
            noise /= np.maximum(size, NOTHING)[:, None]
        return Laid(inners, middles, taken, size, self._followed(followed, taken))

    def _followed(self, noise: Mapping[str, Columns], taken: Mapping[str, FloatArray]) -> Followed:
        """Return the products of the noise of columns, and of what was taken off by instruments."""
        across = {n: products(self._noise[n][:, None], x) for n, x in noise.items()}
        own = {n: products(x, x) for n, x in noise.items()}
        for n, off in taken.items():
            if n not in self._instead:
                continue
            instead, none = self._instead[n], np.zeros(())
            across[n] = across.get(n, none) - products(self._noise[n], instead)[:, None] @ off
            square = off.swapaxes(1, 2) @ products(instead, instead)[:, None] @ off
            own[n] = own.get(n, none) + square
            if n in noise:
                both = products(noise[n], instead[:, None]) @ off
                own[n] -= both + both.swapaxes(2, 3)
        return Followed(across, own)


def products(one: Columns, other: Columns) -> FloatArray:
    """Return the products of columns, shape (..., k, l)."""
    return times(one.swapaxes(-1, -2), other).astype(np.float64)


def times(one: Columns, other: Columns) -> Columns:
    """Return a product of matrices."""
    with np.errstate(invalid="ignore"):  # single-precision kernels raise the flag for padding
        return one @ other


def inverse(gram: FloatArray) -> FloatArray:
    """Return the inverse of a normal matrix, or of several, whose columns differ in scale."""
    scale = 1.0 / np.sqrt(np.diagonal(gram, axis1=-2, axis2=-1) + TINY)
    outer = scale[..., :, None] * scale[..., None, :]
    return np.asarray(np.linalg.inv(gram * outer + 1e-8 * np.eye(gram.shape[-1])) * outer)
