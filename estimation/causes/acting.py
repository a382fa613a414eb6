"""The choices of runs in which a cause may act."""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from estimation.causes.blocks import Products
from estimation.causes.candidates import Candidate, Claim
from estimation.causes.joint import Joint
from estimation.recording import FloatArray

PARTIAL, CHOICES = 24, 6
"""Names tried on some of the runs alone, and choices of runs of each."""

TURNS = 4
"""Turns of fitting an effect to the runs that have it, and of choosing these runs."""


def on_some_runs(joint: Joint, everything: Sequence[tuple[Claim, Products]]) -> list[Claim]:
    """Return named effects that act in some of the runs, as promising as there are."""
    count = len(joint.runs)
    if count < 6:
        return []
    inverse = joint.left_out([[]]).inverse[0]
    named: dict[int, list[tuple[Claim, Products]]] = {}
    for claim, by_run in everything:
        if not claim.is_function:
            named.setdefault(by_run.target.shape[1], []).append((claim, by_run))
    promise: list[tuple[float, Claim, NDArray[np.bool_]]] = []
    for group in named.values():
        products = Products(*map(np.stack, zip(*(by_run for _, by_run in group), strict=True)))
        for acts in _acting(inverse, products):
            gains = _removed(inverse, *(_over(acts, x) for x in products))
            acting = acts.sum(axis=1)
            some = np.flatnonzero((acting > 1) & (acting < count))
            promise += [(float(gains[k]), group[k][0], acts[k]) for k in some]
    promise.sort(key=lambda p: -p[0])
    tried, seen = [], dict[object, set[tuple[bool, ...]]]()
    for _, claim, runs in promise:
        if claim.name not in seen and len(seen) == PARTIAL:
            continue
        known = seen.setdefault(claim.name, set())
        chosen = tuple(runs.tolist())
        if len(known) < CHOICES and chosen not in known:
            known.add(chosen)
            tried.append(Claim(claim.cause, chosen, claim.choices))
    return tried


def one_run_changed(candidate: Candidate) -> Iterator[Claim]:
    """Yield a cause of some runs with one of them more, or less."""
    acts = candidate.acts or ()
    for k, acting in enumerate(acts):
        changed = (*acts[:k], not acting, *acts[k + 1 :])
        if 1 < sum(changed) < len(acts):
            yield Claim(candidate.cause, changed, candidate.choices)


def _acting(inverse: FloatArray, products: Products) -> Iterator[NDArray[np.bool_]]:
    """Yield choices of runs in which candidates act, shape (candidates, runs).

    Each order of the runs is cut where most error goes. From there, the amplitudes and the base are
    fitted to the runs that act, and the runs chosen again in which they lower the error, in turn.
    """
    base, own, cross = products
    candidates, count = cross.shape[:2]
    order = np.broadcast_to(np.arange(count), (candidates, count))
    sizes = np.argsort(_sizes(cross, own), axis=1)
    every = np.arange(candidates)[:, None]
    for runs in (order, order[:, ::-1], sizes, sizes[:, ::-1]):
        sums = [np.cumsum(x[every, runs], axis=1)[:, 1:-1] for x in products]
        cut = np.argmax(_removed(inverse, *sums), axis=1)
        acts = np.zeros((candidates, count), dtype=np.bool_)
        acts[every, runs] = np.arange(count) < cut[:, None] + 2
        yield acts
        for _ in range(TURNS):
            across, square, right = (_over(acts, x) for x in products)
            through = inverse @ across
            fitted = solved(right, square - across.swapaxes(-1, -2) @ through)
            moved = -(through @ fitted[..., None])[..., 0]
            left = cross - np.einsum("crbk,cb->crk", base, moved)
            lower = 2.0 * left - np.einsum("crjk,ck->crj", own, fitted)
            acts = np.einsum("crk,ck->cr", lower, fitted) > 0.0
        yield acts


def _over(acts: NDArray[np.bool_], products: FloatArray) -> FloatArray:
    """Return the sum over the runs in which each candidate acts."""
    return np.asarray(np.einsum("cr,cr...->c...", acts, products))


def _sizes(cross: FloatArray, own: FloatArray) -> FloatArray:
    """Return the size of candidates in each run, of that in all runs, shape (candidates, runs).

    A run that shows little of a candidate is taken to have the size that all runs have.
    """
    everywhere = solved(cross.sum(axis=1), own.sum(axis=1))[:, None]
    shown = np.einsum("crj,crjk,crk->cr", everywhere, own, everywhere)
    apart = (everywhere * cross).sum(axis=-1) - shown
    return np.asarray(apart / (shown + 0.1 * shown.mean(axis=1, keepdims=True) + 1e-300))


def _removed(
    inverse: FloatArray, base: FloatArray, own: FloatArray, cross: FloatArray
) -> FloatArray:
    """Return the error that amplitudes remove, fitted together with the base, shape (...,)."""
    beyond = own - base.swapaxes(-1, -2) @ inverse @ base
    return np.asarray((cross * solved(cross, beyond)).sum(axis=-1))


def solved(cross: FloatArray, own: FloatArray) -> FloatArray:
    """Return amplitudes from products (..., k) and (..., k, k)."""
    size = np.einsum("...kk->...", own)[..., None, None]
    steady = own + (1e-6 * size + 1e-300) * np.eye(own.shape[-1])
    return np.asarray(np.linalg.solve(steady, cross[..., None])[..., 0])
