"""The evidence of a column: error on runs left out, against surrogates, run by run.

The unit of evidence is the run. A candidate's gain is the share of squared error it removes on
runs left out one at a time, the declared parameters refitted together with it each time.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, stats

from estimation.recording import FloatArray

RIDGE = 1e-9
"""Pull towards zero, a share of a column's power: settles columns that the fitted runs lack."""


TOLD_BY_OTHERS = 0.1
"""A run is scored when of every direction of the base the others hold at least this share."""

FEW = 4
"""Up to so many columns a block, sums over samples are faster than many small matrix products."""


@dataclass(frozen=True)
class Losses:
    """Squared errors on the run left out.

    Attributes:
        base: Of the base columns alone, shape (runs, targets).
        joint: Of base and block together, shape (runs, blocks, targets).
    """

    base: FloatArray
    joint: FloatArray

    @property
    def gain(self) -> FloatArray:
        """Share of the pooled squared error each block removes, shape (blocks, targets)."""
        tiny = np.finfo(float).tiny
        share: FloatArray = 1 - self.joint.sum(axis=0) / np.maximum(self.base.sum(axis=0), tiny)
        return share


def leave_one_run_out(
    base: Sequence[FloatArray],
    blocks: Sequence[FloatArray],
    sizes: Sequence[int],
    targets: Sequence[FloatArray],
    ridge: float = RIDGE,
) -> Losses:
    """Score every block of columns, each together with the base, on each run left out.

    A run without which the base cannot be told, such as the only one whose load changes, says
    nothing about a block: it counts alike with and without one.

    Args:
        base: Base columns of each run, shape (n, p).
        blocks: Columns of all blocks side by side, shape (n, sum of sizes).
        sizes: Columns of each block.
        targets: Targets side by side, shape (n, targets): the measured one, then surrogates.
        ridge: Pull on the blocks' columns, a share of their power; the base feels `RIDGE` only.
    """
    base = _scaled(base)
    blocks = _scaled(blocks)
    joint = np.empty((len(base), len(sizes), targets[0].shape[1]))
    alone = _held_out(base, [b[:, :0] for b in base], 0, targets, ridge)
    deciding = _deciding(base)
    starts = np.concatenate([[0], np.cumsum(sizes)[:-1]]).astype(int) if sizes else np.empty(0, int)
    for size in sorted(set(sizes)):
        which = np.flatnonzero(np.asarray(sizes) == size)
        at = (starts[which][:, None] + np.arange(size)).ravel()
        joint[:, which] = _held_out(base, [b[:, at] for b in blocks], size, targets, ridge)
    for r, aim in enumerate(targets):
        if deciding[r]:
            alone[r] = joint[r] = np.einsum("ns,ns->s", aim, aim)
    return Losses(alone[:, 0], joint)


def losses_of(
    base: Sequence[FloatArray], block: Sequence[FloatArray], left: Sequence[FloatArray]
) -> Losses:
    """Score one block of columns beside a base on what that leaves of each run, shape (n,)."""
    return leave_one_run_out(base, block, [block[0].shape[1]], [r[:, None] for r in left])


def _deciding(base: Sequence[FloatArray]) -> NDArray[np.bool_]:
    """Say of each run whether some direction of the base is told by hardly any other."""
    if not base[0].shape[1]:
        return np.zeros(len(base), bool)
    grams = [b.T @ b for b in base]
    pull = RIDGE * np.eye(base[0].shape[1])
    whole = np.sum(grams, axis=0) + pull
    least = [linalg.eigh(whole - g, whole, eigvals_only=True)[0] for g in grams]
    return np.array(least) < TOLD_BY_OTHERS


def _scaled(columns: Sequence[FloatArray]) -> list[FloatArray]:
    power = sum(np.einsum("nk,nk->k", c, c) for c in columns)
    scale = np.sqrt(np.maximum(power, np.finfo(float).tiny))
    return [c / scale for c in columns]


def _held_out(
    base: Sequence[FloatArray],
    blocks: Sequence[FloatArray],
    size: int,
    targets: Sequence[FloatArray],
    ridge: float,
) -> FloatArray:
    """Return losses of blocks of equal size, shape (runs, blocks, targets)."""
    p = base[0].shape[1]
    count = blocks[0].shape[1] // size if size else 1
    q = p + size
    grams, rights, powers = [], [], []
    for b, c, y in zip(base, blocks, targets, strict=True):
        gram = np.empty((count, q, q))
        gram[:, :p, :p] = b.T @ b
        cross = (b.T @ c).reshape(p, count, size).transpose(1, 0, 2)
        gram[:, :p, p:], gram[:, p:, :p] = cross, cross.transpose(0, 2, 1)
        gram[:, p:, p:] = _own_products(c, count, size)
        right = np.empty((count, q, y.shape[1]))
        right[:, :p] = b.T @ y
        right[:, p:] = (c.T @ y).reshape(count, size, y.shape[1])
        grams.append(gram)
        rights.append(right)
        powers.append(np.einsum("ns,ns->s", y, y))
    whole, aim = np.sum(grams, axis=0), np.sum(rights, axis=0)
    pull = np.diag(np.concatenate([np.full(p, RIDGE), np.full(size, max(ridge, RIDGE))]))
    losses = np.empty((len(grams), count, targets[0].shape[1]))
    for r, (gram, right, power) in enumerate(zip(grams, rights, powers, strict=True)):
        weights = np.linalg.solve(whole - gram + pull, aim - right)
        losses[r] = power + np.einsum("kqs,kqs->ks", weights, gram @ weights - 2 * right)
    return np.maximum(losses, 0.0)


def _own_products(c: FloatArray, count: int, size: int) -> FloatArray:
    """Return each block's columns times one another, shape (count, size, size)."""
    if size > FEW:
        cube = c.reshape(len(c), count, size)
        return np.asarray(np.matmul(cube.transpose(1, 2, 0), cube.transpose(1, 0, 2)))
    products = np.empty((count, size, size))
    for i, j in itertools.product(range(size), repeat=2):
        products[:, i, j] = np.einsum("nk,nk->k", c[:, i::size], c[:, j::size])
    return products


def surrogates(left: Sequence[FloatArray], count: int, seed: int) -> list[FloatArray]:
    """Return residuals that keep their rhythm but belong to no column any more.

    Runs are permuted, shifted in a circle and flipped in sign.

    Args:
        left: Residual of each run, shape (n,).
        count: Number of surrogates.
        seed: Seed of the draw.

    Returns:
        One array a run, shape (n, count).
    """
    random = np.random.default_rng(seed)
    drawn = [np.empty((len(r), count)) for r in left]
    for s in range(count):
        order = random.permutation(len(left))
        for r, source in enumerate(order):
            shift = int(random.integers(len(left[source])))
            part = np.resize(np.roll(left[source], shift), len(left[r]))
            drawn[r][:, s] = random.choice([-1.0, 1.0]) * (part - part.mean())
    return drawn


def chance(measured: float, null: FloatArray) -> float:
    """Return the p-value of a gain against gains under the null, never zero."""
    return float((1 + np.count_nonzero(null >= measured)) / (1 + len(null)))


def runs_agree(before: FloatArray, after: FloatArray) -> float:
    """Return the one-sided p-value that errors fell run by run: signed ranks of log ratios.

    Args:
        before: Squared error of each run, shape (runs,).
        after: The same with the effect.
    """
    tiny = np.finfo(float).tiny
    ratio = np.log(np.maximum(after, tiny) / np.maximum(before, tiny))
    ratio = ratio[ratio != 0]
    if ratio.size == 0:
        return 1.0
    if ratio.size > 50:
        return float(stats.wilcoxon(ratio, alternative="less", method="auto").pvalue)
    return float(stats.wilcoxon(ratio, alternative="less", method="exact").pvalue)


def resampled(runs: int, count: int, seed: int) -> NDArray[np.int64]:
    """Return how often each run is drawn in each replicate of a bootstrap, (count, runs)."""
    random = np.random.default_rng(seed)
    weights: NDArray[np.int64] = random.multinomial(runs, np.full(runs, 1 / runs), size=count)
    return weights
