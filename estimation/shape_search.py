"""The search for shape parameters: variable projection on a grid, then a bounded descent."""

from collections.abc import Callable, Sequence

import numpy as np
from scipy import optimize

from estimation.effects import Parameter
from estimation.fit_problem import FitError, Problem, solve
from estimation.recording import FloatArray

MOST_DESCENTS = 20

BEYOND, NEAR = 2.0, 0.01
"""A value beyond those that are searched: by how much it may change, and in one descent."""

FLAT = 1e-6
"""Share of an error by which it may differ where a shape changes nothing."""


def scaled(parameter: Parameter, value: float) -> float:
    """Return a shape parameter's value on the scale it is searched on."""
    return value if parameter.linear else float(np.log(value))


def unscaled(parameter: Parameter, value: float) -> float:
    """Return a shape parameter's value from the scale it is searched on."""
    return float(value) if parameter.linear else float(np.exp(value))


def range_of(parameter: Parameter, known: float | None) -> tuple[float, float]:
    """Return the least and the largest value, on the scale that a shape parameter is searched on.

    A known value may be beyond those that are searched, as the period of a screw in metres is: the
    range then reaches a factor further than it.
    """
    low, high = scaled(parameter, parameter.lower), scaled(parameter, parameter.upper)
    if known is None or _is_searched(parameter, known):
        return low, high
    ends = [scaled(parameter, known * factor) for factor in (1.0 / BEYOND, BEYOND)]
    return min(low, *ends), max(high, *ends)


def _is_searched(parameter: Parameter, value: float) -> bool:
    return parameter.lower <= value <= parameter.upper


def _tried(parameter: Parameter, known: float | None) -> list[float]:
    """Return the values that a search tries first, of which two are a descent apart."""
    if known is None or _is_searched(parameter, known):
        return [float(x) for x in parameter.grid()]
    return [known, (1.0 + NEAR) * known]


def _error_share(problem: Problem, shape: Sequence[float]) -> float:
    """Return the residual power of the best amplitudes, relative to the target's power."""
    gram = np.sum([problem.gram(run, shape) for run in problem.runs], axis=0)
    vector = np.append(solve(problem, gram), -1.0)
    return float(vector @ gram @ vector / max(gram[-1, -1], np.finfo(float).tiny))


def search_shape(problem: Problem, everywhere: bool = True) -> list[float]:
    """Return the shape parameters: a grid along each, twice round, then a bounded descent.

    Unless everywhere, the descent alone, from the known values. Of a known value beyond the grid
    the descent alone, too.
    """
    parameters = problem.shape_parameters
    if not parameters:
        return []
    estimates = [term.values.get(p.name) for term in problem.model.terms for p in term.effect.shape]
    known = [
        one.value if one and (p.linear or one.value > 0.0) else None  # else on no scale
        for one, p in zip(estimates, parameters, strict=True)
    ]
    bounds = [range_of(p, value) for p, value in zip(parameters, known, strict=True)]
    point = [
        float(np.mean(bound)) if value is None else scaled(p, value)
        for value, bound, p in zip(known, bounds, parameters, strict=True)
    ]

    def values(candidate: Sequence[float] | FloatArray) -> list[float]:
        return [unscaled(p, x) for p, x in zip(parameters, candidate, strict=True)]

    def error(candidate: Sequence[float] | FloatArray) -> float:
        try:
            return _error_share(problem, values(candidate))
        except FitError:  # a shape with collinear columns, such as a width far too wide
            return 1.0

    grids = [
        [scaled(p, x) for x in _tried(p, value)] for p, value in zip(parameters, known, strict=True)
    ]
    rounds = (2 if len(parameters) > 1 else 1) if everywhere else 0
    for _ in range(rounds):
        for k, grid in enumerate(grids):
            tried = [[*point[:k], x, *point[k + 1 :]] for x in grid]
            point = min([point, *tried], key=error)
    reach = [abs(grid[1] - grid[0]) for grid in grids]
    return values(_at_ends(error, descended(error, point, reach, bounds), bounds))


def _at_ends(
    error: Callable[[Sequence[float] | FloatArray], float],
    point: list[float],
    bounds: Sequence[tuple[float, float]],
) -> list[float]:
    """Return a minimum with each shape that no run shows at the end of its range.

    The error is the same from there to the minimum but for its rounding, which differs between
    processors and would choose the value.
    """
    least = error(point) * (1.0 + FLAT)
    for k, ends in enumerate(bounds):
        for end in ends:
            moved = [*point[:k], end, *point[k + 1 :]]
            if error(moved) <= least:
                point = moved
                break
    return point


def descended(
    error: Callable[[Sequence[float] | FloatArray], float],
    point: list[float],
    reach: Sequence[float],
    bounds: Sequence[tuple[float, float]],
) -> list[float]:
    """Return the minimum near the best point of the grid, within bounds.

    A line search over all of a parameter's range steps over a narrow valley, such as an order's, so
    each descent moves by at most `reach`, one step of the grid; it restarts from its end while that
    improves the result, since a valley of two shapes is curved. Where the error changes by less
    than its rounding, `scipy` ends without a direction to move in: the point is as good as any
    then.
    """
    point = [min(max(x, low), high) for x, (low, high) in zip(point, bounds, strict=True)]
    left = error(point)
    for _ in range(MOST_DESCENTS):
        near = [
            (max(low, x - step), min(high, x + step))
            for x, step, (low, high) in zip(point, reach, bounds, strict=True)
        ]
        try:
            best = optimize.minimize(
                error, point, method="Powell", bounds=near, options={"xtol": 1e-4, "ftol": 1e-10}
            )
        except ValueError:  # a direction of no length
            break
        gained, left = left - best.fun, min(left, best.fun)
        if gained > 0:
            point = [float(x) for x in best.x]
        if gained <= 1e-5 * left:
            break
    return point
