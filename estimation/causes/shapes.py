"""Shapes of declared terms and of causes next to one another: Gauss-Newton steps.

A width of friction that was fitted without a cause makes up for it, and is another one with it. A
cause was found at a point of a grid. Steps are of the logarithm of a shape, or of its share of how
much the channel varies that has its unit.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from estimation.causes.sources import LATE
from estimation.effects import Parameter
from estimation.model import Estimate, Term
from estimation.recording import FloatArray
from estimation.shape_search import scaled, unscaled

MOST = 0.5
"""Most that a shape moves in one step, on the scale of the steps."""

STEP, RIDGE = 1e-3, 1e-6
"""Step of a derivative by a shape, and share of its square added to a column's."""

Sizes = Mapping[str, float]
"""Channel to its standard deviation."""


Moving = Sequence[Parameter]
"""The shapes of a term that move."""


def moving(term: Term, is_declared: bool) -> Moving:
    """Return the shapes of a term that move.

    A whole number of waves in a turn does not; nor does what a reading is late by, of which slow
    motion shows the product with its amplitude alone. Where friction changes its sign is part of
    what is declared: with another width a cause has the form of another one.
    """
    if term.effect.id in LATE:
        return []
    return [
        p
        for p in term.effect.shape
        if (is_declared or p.name != "width")
        and (_channel(term, p) if p.linear else term.values[p.name].value > 0.0)
    ]


def _channel(term: Term, shape: Parameter) -> str:
    """Return the channel whose range a shape that may be zero is moved by; empty where none is.

    Of a number of waves it is the angle or the position, unless the number is a whole one.
    """
    if shape.name != "order":
        return term.channels.get(shape.unit, "")
    is_whole = term.turning.endswith("_angle_rad") and term.values[shape.name].value.is_integer()
    return "" if is_whole else term.turning


def slopes(
    term: Term,
    shapes: Moving,
    weights: FloatArray,
    sizes: Sizes,
    columns: Callable[[Term], FloatArray],
) -> list[FloatArray]:
    """Return the derivative of a term by each shape, on the scale of the steps, shape (n,) each.

    The weights are its amplitudes; `columns` returns those of a term.
    """
    found = []
    for p in shapes:
        ends = [columns(_with(term, p, sign * STEP, sizes)) @ weights for sign in (1.0, -1.0)]
        found.append((ends[0] - ends[1]) / (2.0 * STEP))
    return found


def moved(
    terms: Sequence[tuple[Term, Moving]], products: FloatArray, share: float, sizes: Sizes
) -> tuple[Term, ...]:
    """Return the terms with their shapes a share of one step towards the least error.

    The products are of all columns, then the slopes, last what is left of the target.
    """
    inner, right = products[:-1, :-1], products[:-1, -1]
    inner = inner + np.diag(RIDGE * np.diag(inner) + np.finfo(float).tiny)
    count = sum(len(shapes) for _, shapes in terms)
    steps = iter(np.linalg.solve(inner, right)[len(right) - count :])
    out = []
    for term, shapes in terms:
        for p in shapes:
            term = _with(term, p, share * float(np.clip(next(steps), -MOST, MOST)), sizes)
        out.append(term)
    return tuple(out)


def _with(term: Term, shape: Parameter, step: float, sizes: Sizes) -> Term:
    known = term.values[shape.name].value
    if shape.linear:
        size = sizes[_channel(term, shape)]
        value = known + step * (1.0 / size if shape.name == "order" else size)
    else:  # one that was found beyond the values that are searched comes no further
        ends = min(shape.lower, known), max(shape.upper, known)
        value = float(np.clip(unscaled(shape, scaled(shape, known) + step), *ends))
    return replace(term, values={**term.values, shape.name: Estimate(value)})
