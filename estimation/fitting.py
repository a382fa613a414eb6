"""Fitting a model on a campaign: amplitudes by least squares, shapes by variable projection.

The runs enter as one small cross-product matrix each, so a bootstrap over runs costs little.
Where offsets of the runs are a nuisance, each run's mean is removed from the target and from every
column, and the model's own offset becomes the mean over the runs.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from estimation.campaign import Campaign
from estimation.effects import Parameter
from estimation.fit_problem import (
    FitRun,
    Problem,
    check_target,
    noisier,
    prepared,
    problem_of,
    solve,
)
from estimation.model import Estimate, Evidence, Model, estimate, parameter_keys, with_values
from estimation.recording import FloatArray
from estimation.shape_search import range_of, scaled, search_shape, unscaled
from estimation.within_bounds import determined, solve_within

SLOPE_STEP = 1e-3  # On the scale that a shape is searched on

IN_INTERVAL = 0.95
"""Share of the replicates that an interval covers."""

Shapes = Literal["search", "near", "keep"]


def fit(
    model: Model,
    campaign: Campaign,
    *,
    every: int | None = None,
    bootstrap: int = 200,
    seed: int = 0,
    shapes: Shapes = "search",
) -> Model:
    """Fit a model on the runs of a campaign that are not excluded.

    Args:
        model: Declared or fitted model; values of shape parameters are where the search starts.
        campaign: The runs; read once, only the model's channels at valid samples are kept.
        every: Keep every n-th sample; by default as many as four times the filter's cutoff needs.
        bootstrap: Number of resamplings of runs behind the spreads; 0 for none.
        seed: Seed of the resampling.
        shapes: Search shape parameters over their whole range, near their values, or keep them.

    Returns:
        The model with values, spreads and evidence. Spreads are to first order in all parameters,
        shapes too. An interval is that of the spread and reaches to the value that readings without
        noise would give, by as much as their noise a second time moves it. A parameter at its
        bound, or fitted on so few runs that resamplings often lack them, has no spread.

    Raises:
        FitError: No valid sample, a target that is constant, or columns that are collinear on these
            runs.
        MissingChannelError: A run lacks a channel of the model.
    """
    problem = problem_of(model, prepared(model, campaign, every))
    check_target(problem)
    if shapes == "keep":
        shape = [x for term in model.terms for x in term.numbers(term.effect.shape)]
    else:
        shape = search_shape(problem, everywhere=shapes == "search")
    grams = [problem.gram(run, shape) for run in problem.runs]
    amplitudes = solve(problem, np.sum(grams, axis=0))
    spreads = _bootstrap(problem, amplitudes, shape, bootstrap, seed)
    drawn = None if spreads is None else _drawn(problem, campaign, amplitudes, shape)
    fitted = _with_numbers(problem, amplitudes, shape, spreads, drawn)
    return replace(fitted, evidence=_evidence(fitted, problem.runs, seed))


def _drawn(
    problem: Problem, campaign: Campaign, free: FloatArray, shape: Sequence[float]
) -> FloatArray:
    """Return by how much the readings' noise has drawn the free amplitudes, shapes as they are.

    A reading with noise has too small an amplitude, and the others make up for it (Fuller,
    "Measurement error models", 1987). Least squares predicts best so, from readings as noisy.
    """
    noisy = replace(problem, runs=noisier(problem.model, campaign, problem.runs), kept={})
    return solve(noisy, np.sum([noisy.gram(run, shape) for run in noisy.runs], axis=0)) - free


def _mean_offset(problem: Problem, shape: Sequence[float], free: FloatArray) -> float:
    """Return the mean over the runs of the residual of the free columns."""
    if problem.offset is None:
        return 0.0
    target = problem.model.target
    left = [run.thin[target] - problem.free_columns(run, shape) @ free for run in problem.runs]
    return float(np.mean([each.mean() for each in left]) * problem.signs[problem.offset])


def _bootstrap(
    problem: Problem, free: FloatArray, shape: list[float], count: int, seed: int
) -> FloatArray | None:
    """Return values over a bootstrap of runs: (replicate, free columns + shapes + offset).

    Each replicate takes one Gauss-Newton step from the fit, with the derivative of the estimate by
    each shape, on the scale it is searched on, as a further column. The step of all runs together,
    which is not zero where shapes are kept, is taken off.
    Parameters at a bound stay there: NaN. The others stay within theirs. A parameter is NaN too in
    a replicate that does not determine it, such as the stiffness of a stop that no run in it meets.
    """
    runs = problem.runs
    if count == 0 or len(runs) < 2:
        return None
    products, means = [], []
    for run in runs:
        columns = problem.free_columns(run, shape)
        left = run.thin[problem.model.target] - columns @ free
        table = np.column_stack([columns, _slopes(problem, run, shape, free), left])
        means.append(table.mean(axis=0))
        if problem.model.run_offsets:
            table = table - means[-1]
        products.append(table.T @ table)
    shapes = problem.shape_parameters
    between = [not _is_at_bound(p, x) for p, x in zip(shapes, shape, strict=True)]
    inside = np.append((free > problem.lower) & (free < problem.upper), np.array(between, bool))
    inside[[k for k in problem.same or () if free[k] == 0.0]] = False  # it is the other one
    moving = np.flatnonzero(inside)
    power = np.diag(np.sum(products, axis=0))[moving]
    size = np.sqrt(np.where(power > 0.0, power, 1.0))
    weights = np.random.default_rng(seed).multinomial(
        len(runs), np.full(len(runs), 1 / len(runs)), size=count
    )
    start = np.concatenate([free, [scaled(p, x) for p, x in zip(shapes, shape, strict=True)]])
    values = np.full((count, len(start) + 1), np.nan)
    ranges = np.reshape([range_of(p, x) for p, x in zip(shapes, shape, strict=True)], (-1, 2))
    low = np.concatenate([problem.lower, ranges[:, 0]]) - start
    high = np.concatenate([problem.upper, ranges[:, 1]]) - start

    def step_of(total: FloatArray) -> FloatArray:
        step, inner = np.zeros(len(start)), total[np.ix_(moving, moving)]
        step[moving] = solve_within(inner, total[moving, -1], low[moving], high[moving])
        return step

    shared = step_of(np.sum(products, axis=0))
    for replicate, weight in enumerate(weights):
        total = np.tensordot(weight, products, axes=1)
        step = np.clip(step_of(total) - shared, low, high)
        normal = total[np.ix_(moving, moving)] / np.outer(size, size)
        known = moving[determined(normal)]
        values[replicate, known] = (start + step)[known]
        if problem.offset is not None:
            mean = np.average(means, axis=0, weights=weight)
            values[replicate, -1] = (mean[-1] - mean[:-1] @ step) * problem.signs[problem.offset]
    for k, parameter in enumerate(shapes, start=len(free)):
        if not parameter.linear:
            values[:, k] = np.exp(values[:, k])
    return values


def shapes_at_bound(fitted: Model, campaign: Campaign) -> set[str]:
    """Return the keys of the shape parameters that are at an end of their range on some runs.

    The range of a width follows from the speeds there: see `fit_problem.problem_of`.
    """
    shapes = problem_of(fitted, prepared(fitted, campaign)).shape_parameters
    known = [(t, p, key) for t, p, key in parameter_keys(fitted) if p in t.effect.shape]
    return {
        key
        for shape, (term, p, key) in zip(shapes, known, strict=True)
        if not p.is_count and _is_at_bound(shape, term.values[p.name].value)
    }


def _is_at_bound(parameter: Parameter, value: float) -> bool:
    """Whether a shape is at an end of its range, as near as it is searched."""
    at, *ends = (scaled(parameter, x) for x in (value, parameter.lower, parameter.upper))
    return min(abs(at - end) for end in ends) < SLOPE_STEP * (ends[1] - ends[0])


def _slopes(problem: Problem, run: FitRun, shape: list[float], free: FloatArray) -> FloatArray:
    """Return the derivative of the estimate by each shape on its scale, shape (n, shapes)."""
    slopes = np.empty((run.places.size, len(shape)))
    for k, parameter in enumerate(problem.shape_parameters):
        ends = []
        for sign in (1, -1):
            moved = unscaled(parameter, scaled(parameter, shape[k]) + sign * SLOPE_STEP)
            ends.append(problem.free_columns(run, [*shape[:k], moved, *shape[k + 1 :]]) @ free)
        slopes[:, k] = (ends[0] - ends[1]) / (2 * SLOPE_STEP)
    return slopes


def _with_numbers(
    problem: Problem,
    free: FloatArray,
    shape: list[float],
    spreads: FloatArray | None,
    drawn: FloatArray | None,
) -> Model:
    """Return the model with its numbers in place, without evidence."""
    amplitudes = np.full(len(problem.names), _mean_offset(problem, shape, free))
    amplitudes[problem.free] = free
    place = np.full(len(problem.names), -1)  # the offset is the bootstrap's last column
    place[problem.free] = np.arange(len(free))
    by_noise = np.append(np.zeros(len(free)) if drawn is None else drawn, 0.0)
    low, high = np.append(problem.lower, -np.inf), np.append(problem.upper, np.inf)
    sizes = iter(
        [
            _estimate(x, spreads, k, (float(low[k]), float(high[k])), float(by_noise[k]))
            for x, k in zip(amplitudes, place, strict=True)
        ]
    )
    shapes = iter([_estimate(x, spreads, k) for k, x in enumerate(shape, start=len(free))])
    values = [
        {p.name: next(sizes) for p in term.effect.amplitudes}
        | {p.name: next(shapes) for p in term.effect.shape}
        for term in problem.model.terms
    ]
    return with_values(problem.model, values)


def _estimate(
    value: float,
    spreads: FloatArray | None,
    column: int,
    bounds: tuple[float, float] = (-np.inf, np.inf),
    drawn: float = 0.0,
) -> Estimate:
    if spreads is None:
        return Estimate(float(value))
    replicates = spreads[np.isfinite(spreads[:, column]), column]
    if len(replicates) < IN_INTERVAL * len(spreads):  # the others may have any value
        return Estimate(float(value))
    low, high = interval95(value, replicates)
    reached = max(bounds[0], min(low, low - drawn)), min(bounds[1], max(high, high - drawn))
    return Estimate(float(value), float(replicates.std(ddof=1)), reached)


def interval95(value: float, replicates: FloatArray) -> tuple[float, float]:
    """Return the 95 % interval of a bootstrap; where few runs carry a value, wide enough for it."""
    low, high = np.percentile(replicates, [2.5, 97.5])
    return min(float(low), float(value)), max(float(high), float(value))


def _evidence(fitted: Model, runs: list[FitRun], seed: int) -> Evidence:
    targets = [run.whole[fitted.target][run.places] for run in runs]
    errors = [
        target - estimate(fitted, run.whole)[run.places]
        for target, run in zip(targets, runs, strict=True)
    ]
    samples = sum(len(error) for error in errors)
    squares = sum(float(error @ error) for error in errors)
    centred = sum(float(np.sum((error - error.mean()) ** 2)) for error in errors)
    return Evidence(
        runs=tuple(run.whole.name for run in runs),
        samples=samples,
        rmse=float(np.sqrt(centred / samples)),
        rmse_with_means=float(np.sqrt(squares / samples)),
        seed=seed,
        run_spread=_run_spread(fitted, errors),
        target_range=(float(min(map(np.min, targets))), float(max(map(np.max, targets)))),
        # of time stamps, whose rounding a rate of so many digits does not show
        sample_rate_hz=float(f"{np.median([run.whole.sample_rate_hz for run in runs]):.6g}"),
        rig=", ".join(sorted({run.whole.rig for run in runs} - {""})),
        is_simulated=any(run.whole.is_simulated for run in runs),
    )


def _run_spread(fitted: Model, errors: Sequence[FloatArray]) -> float | None:
    """Return how much runs differ: the standard deviation of the logarithm of their errors."""
    powers = np.array([e.var() if fitted.run_offsets else np.mean(e**2) for e in errors])
    if len(powers) < 2 or not np.all(powers > 0):
        return None
    return float(np.std(0.5 * np.log(powers), ddof=1))
