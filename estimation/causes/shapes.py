"""Shapes of declared terms next to causes: Gauss-Newton steps of their logarithms.

A width of friction that was fitted without a cause makes up for it, and is another one with it.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from estimation.effects import Parameter
from estimation.model import Estimate, Term
from estimation.recording import FloatArray
from estimation.shape_search import scaled, unscaled

MOST = 0.5
"""Most that the logarithm of a shape moves in one step."""

STEP, RIDGE = 1e-3, 1e-6
"""Step of a derivative by the logarithm of a shape, and share of its square added to a column's."""


def any_of(terms: Sequence[Term]) -> bool:
    """Whether a term has a shape that moves."""
    return any(_moving(term) for term in terms)


def slopes(
    terms: Sequence[Term], weights: FloatArray, columns: Callable[[Term], FloatArray]
) -> FloatArray:
    """Return the derivative of the terms' sum by the logarithm of each shape, shape (n, shapes).

    The weights are their amplitudes, and others after them; `columns` returns those of a term.
    """
    found, at = [], 0
    for term in terms:
        own = weights[at : at + len(term.effect.amplitudes)]
        at += len(own)
        for p in _moving(term):
            ends = [columns(_with(term, p, sign * STEP)) @ own for sign in (1.0, -1.0)]
            found.append((ends[0] - ends[1]) / (2.0 * STEP))
    return np.column_stack(found)


def moved(terms: Sequence[Term], products: FloatArray, share: float) -> tuple[Term, ...]:
    """Return the terms with their shapes a share of one step towards the least error.

    The products are of all columns, then the slopes, last what is left of the target.
    """
    inner, right = products[:-1, :-1], products[:-1, -1]
    inner = inner + np.diag(RIDGE * np.diag(inner) + np.finfo(float).tiny)
    shapes = sum(len(_moving(term)) for term in terms)
    steps = iter(np.linalg.solve(inner, right)[len(right) - shapes :])
    out = []
    for term in terms:
        for p in _moving(term):
            term = _with(term, p, share * float(np.clip(next(steps), -MOST, MOST)))
        out.append(term)
    return tuple(out)


def _moving(term: Term) -> list[Parameter]:
    """Return the shapes that move: those that are searched on a logarithmic scale."""
    return [p for p in term.effect.shape if not p.linear and term.values[p.name].value > 0.0]


def _with(term: Term, shape: Parameter, step: float) -> Term:
    value = unscaled(shape, scaled(shape, term.values[shape.name].value) + step)
    return replace(term, values={**term.values, shape.name: Estimate(value)})
