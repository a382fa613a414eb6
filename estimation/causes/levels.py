"""Declared amplitudes from the means of runs as well.

A model is fitted within runs, where an unknown zero of each run takes no part. A load that is held
within each run then says nothing of its ratio. Here a run's zero is a random effect, and its
variance comes from restricted maximum likelihood (Patterson and Thompson 1971; Laird and Ware
1982): where zeros scatter little, the means of runs count much.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from estimation.causes.equations import Equation, equation_of
from estimation.causes.joint import Joint
from estimation.causes.layout import Layout
from estimation.causes.numbers import DEFAULT, Numbers
from estimation.model import Estimate
from estimation.recording import FloatArray
from estimation.within_bounds import LEAST_SHARE, solve_within

LARGEST_RATIO, RATIOS = 1e8, 80
"""Variances of a run's zero that are tried, as shares of the variance within runs."""


def with_levels(layout: Layout, train: Sequence[str], numbers: Numbers = DEFAULT) -> Layout:
    """Return a layout with amplitudes that are fitted between training runs as well as within."""
    joint = Joint(layout.select(train), numbers)
    made = {n: _refitted(equation, joint) for n, equation in layout.equations.items()}
    return replace(layout, equations=made)


def _refitted(equation: Equation, joint: Joint) -> Equation:
    parts = [(t.effect.amplitudes, t.values) for t in equation.terms]
    fitted = np.array([values[p.name].value for some, values in parts for p in some])
    bounds = [[p.lower, p.upper] for some, _ in parts for p in some]
    low, high = np.array([*bounds, [-np.inf, np.inf]]).T - np.append(fitted, 0.0)
    products = _products(equation, joint, fitted)
    change = solve_within(products[:-1, :-1], products[:-1, -1], low, high)
    new = iter(np.clip(fitted + change[:-1], *np.reshape(bounds, (-1, 2)).T))
    terms = list(equation.model.terms)
    for k, term in enumerate(terms):
        if term in equation.terms:  # all but an offset of all runs
            values = {p.name: Estimate(float(next(new))) for p in term.effect.amplitudes}
            terms[k] = replace(term, values={**term.values, **values})
    return equation_of(replace(equation.model, terms=tuple(terms)))


def _products(equation: Equation, joint: Joint, fitted: FloatArray) -> FloatArray:
    """Return the products of columns and residual, at the likeliest weight of the runs' means."""
    runs, each = len(joint.runs), joint.numbers.samples_a_run
    residual = np.eye(len(fitted) + 2)
    residual[-1, :-2] = -fitted
    within, between = (
        residual @ joint.declared_products((equation.name, kind)) @ residual.T
        for kind in ("within", "between")
    )
    within *= each / joint.samples[equation.name, "within"].mean()
    within[-1, :-1] = within[:-1, -1] = 0.0  # the fit is the best within runs
    ratios = np.geomspace(joint.numbers.between, LARGEST_RATIO, RATIOS)
    tried = [within + between / ratio for ratio in ratios]
    costs = [
        _cost(products, runs * (each + 1)) + runs * np.log(ratio)
        for products, ratio in zip(tried, ratios, strict=True)
    ]
    best: FloatArray = tried[int(np.argmin(costs))]
    return best


def _cost(products: FloatArray, samples: float) -> float:
    """Return twice the negative restricted log likelihood, but for the variances' ratio."""
    used = np.flatnonzero(np.diagonal(products)[:-1] > 0.0)
    normal, right = products[np.ix_(used, used)], products[used, -1]
    scale = 1.0 / np.sqrt(np.diagonal(normal))
    sizes, axes = np.linalg.eigh(normal * scale[:, None] * scale)
    sizes = np.maximum(sizes, LEAST_SHARE * sizes[-1])
    fitted = float((((scale * right) @ axes) ** 2 / sizes).sum())
    left = max(float(products[-1, -1]) - fitted, LEAST_SHARE * float(products[-1, -1]))
    free = samples - len(used)
    return float(free * np.log(left) + np.log(sizes).sum() - 2.0 * np.log(scale).sum())
