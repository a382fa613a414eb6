"""Candidates next to a regression's base: fitted together with it, and judged on what was left out.

Candidates of one place with as many columns each share every step, so a search over thousands of
them costs a few large products.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimation.causes.criterion import log_ratio
from estimation.causes.folds import Folds
from estimation.causes.joint import Joint, Next
from estimation.causes.laid import TINY, Followed, Laid, Part, products
from estimation.recording import FloatArray


class Products(NamedTuple):
    """Products of causes' columns in each run.

    Attributes:
        base: The base's columns times the causes', shape (runs, causes, base, k).
        own: The causes' columns times themselves, shape (runs, causes, k, k).
        target: The causes' columns times the target, shape (runs, causes, k).
    """

    base: FloatArray
    own: FloatArray
    target: FloatArray


@dataclass(frozen=True)
class Block:
    """Cross-products of causes with a regression's base.

    Attributes:
        followed: The noise that the causes follow.
        of: Part to its products.
        taken: How much of each declared column was taken off them, (causes, declared, k).
        weights: Part to the weight of one squared residual.
    """

    followed: Followed
    of: Mapping[Part, Products]
    taken: FloatArray
    weights: Mapping[Part, float]

    @cached_property
    def whole(self) -> Products:
        """Weighted sum of the products of all parts."""
        return self.summed(self.of)

    def only(self, chosen: NDArray[np.bool_]) -> "Block":
        """Return some of the causes."""
        of = {p: Products(*(x[:, chosen] for x in known)) for p, known in self.of.items()}
        return Block(self.followed.only(chosen), of, self.taken[chosen], self.weights)

    def summed(self, parts: Iterable[Part]) -> Products:
        """Return the weighted sum of the products of some parts."""
        weighted = [[self.weights[p] * x for x in self.of[p]] for p in parts]
        return Products(*(np.asarray(sum(kind)) for kind in zip(*weighted, strict=True)))


@dataclass(frozen=True)
class Outcome:
    """Causes of one block, fitted and left out.

    Attributes:
        promising: Which of them could be worth a price, shape (causes,).
        errors: For each family of folds, part to squared error of these, (runs, promising).
        amplitudes: On all runs, shape (causes, k).
        changes: Equation to the factor by which the term of each channel times a constant changes,
            shape (causes, channels).
        slopes: The same within runs, the causes' own contribution included.
        by_run: Weighted products in each run, with the base's residual as the target.
        declared: Declared amplitudes next to each cause, shape (causes, declared).
        gram: Weighted products of the declared columns in each run, as those of `by_run`.
    """

    promising: NDArray[np.bool_]
    errors: Sequence[Mapping[Part, FloatArray]]
    amplitudes: FloatArray
    changes: Mapping[str, FloatArray]
    slopes: Mapping[str, FloatArray]
    by_run: Products
    declared: FloatArray
    gram: FloatArray

    def factor(self, one: int, runs: NDArray[np.intp]) -> float:
        """Return the factor by which a cause changes what is declared in some runs."""
        declared, gram = self.declared[one], self.gram[runs].sum(axis=0)
        added = self.by_run.base[runs, one].sum(axis=0)[: len(declared)] @ self.amplitudes[one]
        return 1.0 + float(declared @ added / (declared @ gram @ declared + TINY))


def block_of(joint: Joint, laid: Laid, known: Block | None = None) -> Block:
    """Return causes' products with a regression; those with a part of its base may be known."""
    of, runs, k = {}, len(joint.runs), laid.size.shape[1]
    for p in joint.parts:
        if (columns := laid.part(p)) is None:
            continue
        # a residual may be a millionth of its target: products of single precision would hide it
        columns, table, places = columns.astype(np.float64), joint.tables[p], [*joint.at[p]]
        base = np.zeros((runs, len(laid), joint.size, k))
        if known is None:
            product = products(table[:, None], columns)
            base[:, :, places] = product[:, :, :-1]
            of[p] = Products(base, products(columns, columns), product[:, :, -1])
            continue
        before = known.of[p].base.shape[2]
        base[:, :, :before] = known.of[p].base
        new = [i for i, place in enumerate(places) if place >= before]
        if new:
            added = products(table[:, None, :, new], columns)
            base[:, :, [places[i] for i in new]] = added
        of[p] = known.of[p]._replace(base=base)
    taken = joint.taken_off(laid) if known is None else known.taken
    return Block(laid.followed, of, taken, joint.weights)


def evaluate(
    joint: Joint,
    block: Block,
    folds: Folds,
    precision: FloatArray,
    usual: FloatArray,
) -> Outcome:
    """Fit every cause together with the base and return its errors on what was left out.

    Prior precisions of the amplitudes have the shape (causes, k), the parameters of the base alone
    (base,).
    """
    (base,), (amplitudes,) = _Fitting(joint, block, precision).left_out([[]])
    promising = _gain(joint, block, base, amplitudes, usual) >= joint.numbers.cause_cost
    errors = []
    if promising.any():
        errors = errors_of(joint, block.only(promising), folds, precision[promising])
    # runs that have offsets of their own show nothing of a cause by their means
    parts = [p for p in block.of if p[1] == "within" or not joint.has_offsets(p[0])]
    cross, own, right = block.summed(parts)
    declared = _declared(joint, block, base, amplitudes)
    changes, slopes = {}, {}
    for name in {name for name, _ in block.of}:
        at = [*joint.linear(name)]
        usual_there = joint.whole(usual)[at]
        given = _per_unit(joint, block, (name, "within"), at, amplitudes)
        # of an amplitude at its bound of zero no other one is a multiple
        is_held = joint.held[at] | (usual_there == 0.0)
        factor = np.where(is_held, 1.0, usual_there)
        changes[name] = np.where(is_held, 1.0, declared[:, at] / factor)
        slopes[name] = np.where(is_held, 1.0, (declared[:, at] + given) / factor)
    # the columns as they were before declared ones were taken off: in some runs these differ
    gram = np.asarray(sum(joint.weights[p] * joint.gram[p] for p in parts))
    count = block.taken.shape[1]
    mixed = block.taken.swapaxes(1, 2) @ cross[:, :, :count]
    own = own + mixed + mixed.swapaxes(2, 3)
    own += block.taken.swapaxes(1, 2) @ gram[:, None, :count, :count] @ block.taken
    right = right + (gram[:, None, None, :count, -1] @ block.taken)[:, :, 0]
    cross = cross + gram[:, None, :-1, :count] @ block.taken
    by_run = Products(cross, own, right - usual @ cross)
    inner = gram[:, :count, :count]
    return Outcome(promising, errors, amplitudes, changes, slopes, by_run, declared, inner)


def rising(
    joint: Joint, block: Block, precision: FloatArray
) -> Iterator[tuple[NDArray[np.bool_], NDArray[np.bool_]]]:
    """Yield which amplitudes of the base stay held at their bound next to some causes, and these.

    Shapes (declared,) and (causes,). Only where not all stay that the base alone holds.
    """
    if not joint.held.any():
        return
    free = joint.holding(np.zeros_like(joint.held))
    (base,), (amplitudes,) = _Fitting(free, block, precision).left_out([[]])
    below = joint.held & (_declared(free, block, base, amplitudes) < 0.0)
    for held in np.unique(below, axis=0):
        if (held != joint.held).any():
            yield held, (below == held).all(axis=1)


def _declared(joint: Joint, block: Block, base: FloatArray, amplitudes: FloatArray) -> FloatArray:
    """Return the declared amplitudes, with what was taken off the columns of causes."""
    return np.asarray(joint.whole(base) - np.einsum("cdk,ck->cd", block.taken, amplitudes))


def errors_of(
    joint: Joint,
    block: Block,
    folds: Folds,
    precision: FloatArray,
    judged: Block | None = None,
) -> list[Mapping[Part, FloatArray]]:
    """Return the squared errors on what each family of folds left out, (runs, causes) a part.

    Args:
        joint: The regression.
        block: The causes that are fitted.
        folds: Families of folds.
        precision: Prior precision of their amplitudes, shape (causes, k).
        judged: The same causes by whose columns the errors are judged; the fitted ones if None.
    """
    fitting, judged = _Fitting(joint, block, precision), judged or block
    errors: list[Mapping[Part, FloatArray]] = []
    for family in folds:
        fits = joint.left_out(family)
        base, amplitudes = (x[fits.fold] for x in fitting.left_out(family))
        found = {}
        for p in joint.parts:
            found[p] = np.zeros((len(joint.runs), len(precision)))
            found[p][fits.runs] = _squared(joint, judged, p, fits.runs, base, amplitudes)
        errors.append(found)
    return errors


class _Fitting:
    """Causes of a block, fitted together with the base."""

    def __init__(self, joint: Joint, block: Block, precision: FloatArray) -> None:
        self.joint, self.precision = joint, precision
        self._sums = block.whole
        self._of_prior = joint.prior_products(block.taken)
        declared = self._of_prior[:, : block.taken.shape[1]]
        self._own_prior = -block.taken.swapaxes(1, 2) @ declared

    def left_out(self, family: Sequence[Sequence[int]]) -> tuple[FloatArray, FloatArray]:
        """Return the base and the amplitudes without each fold, (folds, causes, .) each."""
        fits = self.joint.left_out(family)
        cross, own, right = (x.sum(axis=0) - np.tensordot(fits.left, x, 1) for x in self._sums)
        cross, own = cross + self._of_prior, own + self._own_prior
        through = fits.inverse[:, None] @ cross
        eye = np.eye(own.shape[-1])
        spread = 1e-9 * np.einsum("fckk->fck", own) + self.precision
        schur = own - cross.swapaxes(2, 3) @ through + spread[..., None] * eye
        left = right - (fits.base[:, None, None] @ cross)[:, :, 0]
        amplitudes = np.linalg.solve(schur, left[..., None])
        return fits.base[:, None] - (through @ amplitudes)[..., 0], amplitudes[..., 0]


def _gain(
    joint: Joint, block: Block, base: FloatArray, amplitudes: FloatArray, usual: FloatArray
) -> FloatArray:
    """Return the score of causes on the runs that they were fitted on, shape (causes,).

    What is left out shows less. A cause that is not even worth its least price here is none.
    """
    usual, total = np.append(usual, -1.0), np.zeros(len(base))
    for p in joint.parts:
        gram, samples = joint.gram[p].sum(axis=0), joint.samples[p].sum()
        products = Products(*(x.sum(axis=0)[None] for x in block.of[p])) if p in block.of else None
        (error,) = _residual(gram[None], products, base[None], amplitudes[None])
        before = float(usual @ gram @ usual)
        total += log_ratio(joint, p, max(before, 0.0) / samples, error / samples)
    return total


def _per_unit(
    joint: Joint, block: Block, p: Part, at: Sequence[int], amplitudes: FloatArray
) -> FloatArray:
    """Return the slopes of causes' contribution over declared columns, (causes, columns)."""
    across = joint.gram[p][:, at, : block.taken.shape[1]].sum(axis=0)
    raw = block.of[p].base[:, :, at].sum(axis=0) + np.einsum("jd,cdk->cjk", across, block.taken)
    own = across[range(len(at)), at]
    return np.asarray(np.einsum("cjk,ck->cj", raw, amplitudes) / np.where(own > 0.0, own, 1.0))


def _squared(
    joint: Joint,
    block: Block,
    p: Part,
    runs: NDArray[np.intp],
    base: FloatArray,
    amplitudes: FloatArray,
) -> FloatArray:
    """Return squared errors of runs, (n, causes), of parameters (n, causes, .)."""
    products = Products(*(x[runs] for x in block.of[p])) if p in block.of else None
    error = _residual(joint.gram[p][runs], products, base, amplitudes)
    next_to = Next(block.followed, amplitudes, (block.taken @ amplitudes[..., None])[..., 0])
    return np.asarray(error + joint.avoided(p, runs, base, next_to))


def _residual(
    gram: FloatArray,
    products: Products | None,
    base: FloatArray,
    amplitudes: FloatArray,
) -> FloatArray:
    """Return squared residuals, (n, causes), of parameters (n, causes, .) from cross-products."""
    error = ((base @ gram[:, :-1, :-1]) * base).sum(axis=2) + gram[:, None, -1, -1]
    error -= 2.0 * (base @ gram[:, :-1, -1:])[..., 0]
    if products is not None:
        across = (base[:, :, None] @ products.base)[:, :, 0]
        own = (amplitudes[:, :, None] @ products.own)[:, :, 0]
        error += ((2.0 * (across - products.target) + own) * amplitudes).sum(axis=2)
    return np.asarray(np.maximum(error, 0.0))
