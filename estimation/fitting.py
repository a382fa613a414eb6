"""Fitting a model on a campaign: amplitudes by least squares, shapes by variable projection.

The runs enter as one small cross-product matrix each, so a bootstrap over runs costs little.
Where offsets of the runs are a nuisance, each run's mean is removed from the target and from every
column, and the model's own offset becomes the mean over the runs.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from estimation.campaign import Campaign
from estimation.derived import CAMPAIGN_TIME
from estimation.effects import Parameter, Remembering
from estimation.errors import EstimationError
from estimation.model import (
    Estimate,
    Evidence,
    Model,
    Term,
    balance_channels,
    estimate,
    settled,
    with_values,
)
from estimation.recording import FloatArray, Recording
from estimation.within_bounds import solve_within

OFFSET = "sensor.offset"
MOST_DESCENTS = 20
SLOPE_STEP = 1e-3  # On the scale that a shape is searched on

Shapes = Literal["search", "near", "keep"]


class FitError(EstimationError):
    """The model's parameters are not identifiable from the campaign."""


@dataclass(frozen=True)
class FitRun:
    """A run's filtered channels, whole for effects with memory, and the samples of the fit."""

    whole: Recording
    places: NDArray[np.intp]
    thin: Recording

    def columns(self, term: Term, shape: Sequence[float]) -> FloatArray:
        """Return an effect's columns at the samples of the fit."""
        if isinstance(term.effect, Remembering):
            return np.asarray(term.columns(self.whole, shape)[self.places])
        return term.columns(self.thin, shape)


@dataclass(frozen=True)
class _Problem:
    """A model laid out for fitting: its runs and which columns are which."""

    model: Model
    runs: list[FitRun]
    free: NDArray[np.intp]  # columns that least squares solves for
    offset: int | None  # column of the model's own offset when run offsets replace it
    names: list[str]  # of all columns
    signs: FloatArray
    lower: FloatArray
    upper: FloatArray
    kept: dict[tuple[int, int], tuple[list[float], FloatArray]] = field(default_factory=dict)
    """Each run's and term's last shape and columns: a search moves one term's shape at a time."""

    @property
    def shape_parameters(self) -> list[Parameter]:
        """Shape parameters of all terms, in order."""
        return [p for term in self.model.terms for p in term.effect.shape]

    def columns(self, run: FitRun, shape: Sequence[float]) -> FloatArray:
        """Return all signed columns of a run, shape (n, columns)."""
        blocks = []
        rest = list(shape)
        for place, term in enumerate(self.model.terms):
            own, rest = rest[: len(term.effect.shape)], rest[len(term.effect.shape) :]
            last = self.kept.get((id(run), place))
            if last is None or last[0] != own:
                last = self.kept[id(run), place] = own, run.columns(term, own)
            blocks.append(last[1])
        return np.column_stack(blocks) * self.signs

    def gram(self, run: FitRun, shape: Sequence[float]) -> FloatArray:
        """Return the cross-products of free columns and target of one run."""
        table = np.column_stack(
            [self.columns(run, shape)[:, self.free], run.thin[self.model.target]]
        )
        if self.model.run_offsets:
            table -= table.mean(axis=0)
        product: FloatArray = table.T @ table
        return product


def fit(
    model: Model,
    campaign: Campaign,
    *,
    run_offsets: bool | None = None,
    every: int | None = None,
    bootstrap: int = 200,
    seed: int = 0,
    shapes: Shapes = "search",
) -> Model:
    """Fit a model on the runs of a campaign that are not excluded.

    Args:
        model: Declared or fitted model; values of shape parameters are where the search starts.
        campaign: The runs; read once, only the model's channels at valid samples are kept.
        run_offsets: Treat an offset of each run as a nuisance; the model's own choice if None.
        every: Keep every n-th sample; by default as many as four times the filter's cutoff needs.
        bootstrap: Number of resamplings of runs behind the spreads; 0 for none.
        seed: Seed of the resampling.
        shapes: Search shape parameters over their whole range, near their values, or keep them.

    Returns:
        The model with values, spreads and evidence. Spreads are to first order in all parameters,
        shapes too. A parameter at its bound, or fitted on a single run, has no spread.

    Raises:
        FitError: No valid sample, or columns that are collinear on these runs.
        MissingChannelError: A run lacks a channel of the model.
    """
    if run_offsets is not None:
        model = replace(model, run_offsets=run_offsets)
    problem = _problem(model, prepared(model, campaign, every))
    if shapes == "keep":
        shape = [x for term in model.terms for x in term.numbers(term.effect.shape)]
    else:
        shape = _search_shape(problem, everywhere=shapes == "search")
    grams = [problem.gram(run, shape) for run in problem.runs]
    amplitudes = _solve(problem, np.sum(grams, axis=0))
    offset = _mean_offset(problem, shape, amplitudes)
    fitted = _with_numbers(problem, amplitudes, shape, offset)
    spreads = _bootstrap(problem, amplitudes, shape, bootstrap, seed)
    return _with_numbers(
        problem, amplitudes, shape, offset, spreads, _evidence(fitted, problem.runs, seed)
    )


def evidence_of(fitted: Model, campaign: Campaign, seed: int = 0) -> Evidence:
    """Return the evidence of a model that was fitted elsewhere, on the runs of its fit.

    Args:
        fitted: The model.
        campaign: The runs, counted as `fit` counts them.
        seed: Seed of the bootstrap behind its spreads.

    Raises:
        FitError: No valid sample.
        MissingChannelError: A run lacks a channel of the model.
    """
    return _evidence(fitted, prepared(fitted, campaign, None), seed)


def prepared(model: Model, campaign: Campaign, every: int | None = None) -> list[FitRun]:
    """Read the runs and find every n-th valid sample of them that a fit counts.

    Args:
        model: The model.
        campaign: The runs.
        every: Keep every n-th sample; by default as many as four times the filter's cutoff needs.

    Raises:
        FitError: No valid sample.
        MissingChannelError: A run lacks a channel of the model.
    """
    runs = []
    timed = campaign.timed() if CAMPAIGN_TIME in model.channels else campaign
    for recording in timed.evidence:
        step = every or max(1, int(recording.sample_rate_hz / (4 * model.low_pass.cutoff_hz)))
        whole = balance_channels(model, recording)
        places = settled(model, whole, step)
        if places.size:
            runs.append(FitRun(whole, places, whole.at(places)))
    if not runs:
        raise FitError(
            f"No valid samples to fit model {model.name!r}.",
            f"{len(campaign)} runs, {len(campaign.evidence)} of them not excluded; static samples"
            " do not count where friction is fitted.",
            "Record runs in which the rig moves.",
        )
    return runs


def _problem(model: Model, runs: list[FitRun]) -> _Problem:
    parameters = [(term, p) for term in model.terms for p in term.effect.amplitudes]
    names = [f"{term.effect.id}.{p.name}" for term, p in parameters]
    offset = names.index(f"{OFFSET}.offset") if f"{OFFSET}.offset" in names else None
    replaced = offset if model.run_offsets else None
    free = np.array([k for k in range(len(names)) if k != replaced], dtype=np.intp)
    return _Problem(
        model=model,
        runs=runs,
        free=free,
        offset=replaced,
        names=names,
        signs=np.array([float(term.sign) for term, _ in parameters]),
        lower=np.array([p.lower for _, p in parameters])[free],
        upper=np.array([p.upper for _, p in parameters])[free],
    )


def _solve(problem: _Problem, gram: FloatArray) -> FloatArray:
    """Return the amplitudes of the free columns within their bounds."""
    if problem.free.size == 0:
        return np.empty(0)
    scale = np.sqrt(np.maximum(np.diag(gram)[:-1], np.finfo(float).tiny))
    normal = gram[:-1, :-1] / np.outer(scale, scale)
    _check_independent(problem, normal, np.diag(gram)[:-1])
    return solve_within(gram[:-1, :-1], gram[:-1, -1], problem.lower, problem.upper)


def _check_independent(problem: _Problem, normal: FloatArray, power: FloatArray) -> None:
    values, vectors = np.linalg.eigh(normal)
    if np.all(power > 0) and values[0] > 1e-10:
        return
    guilty = np.abs(vectors[:, 0]) > 0.1 if np.all(power > 0) else power <= 0
    named = ", ".join(problem.names[k] for k in problem.free[guilty])
    raise FitError(
        f"{named} cannot be identified from these runs.",
        "The columns are constant or proportional to one another in every run.",
        "Take an effect out of the model, or record runs that excite it.",
    )


def _scaled(parameter: Parameter, value: float) -> float:
    """Return a shape parameter's value on the scale it is searched on."""
    return value if parameter.linear else float(np.log(value))


def _unscaled(parameter: Parameter, value: float) -> float:
    return float(value) if parameter.linear else float(np.exp(value))


def _error_share(problem: _Problem, shape: Sequence[float]) -> float:
    """Return the residual power of the best amplitudes, relative to the target's power."""
    gram = np.sum([problem.gram(run, shape) for run in problem.runs], axis=0)
    vector = np.append(_solve(problem, gram), -1.0)
    return float(vector @ gram @ vector / max(gram[-1, -1], np.finfo(float).tiny))


def _search_shape(problem: _Problem, everywhere: bool = True) -> list[float]:
    """Return the shape parameters: a grid along each, twice round, then a bounded descent.

    Unless everywhere, the descent alone, from the known values.
    """
    parameters = problem.shape_parameters
    if not parameters:
        return []
    bounds = [(_scaled(p, p.lower), _scaled(p, p.upper)) for p in parameters]
    known = [term.values.get(p.name) for term in problem.model.terms for p in term.effect.shape]
    point = [
        float(np.clip(_scaled(p, start.value), *bound)) if start else float(np.mean(bound))
        for start, bound, p in zip(known, bounds, parameters, strict=True)
    ]

    def values(candidate: Sequence[float] | FloatArray) -> list[float]:
        return [_unscaled(p, x) for p, x in zip(parameters, candidate, strict=True)]

    def error(candidate: Sequence[float] | FloatArray) -> float:
        try:
            return _error_share(problem, values(candidate))
        except FitError:  # a shape with collinear columns, such as a width far too wide
            return 1.0

    grids = [[_scaled(p, float(x)) for x in p.grid()] for p in parameters]
    rounds = (2 if len(parameters) > 1 else 1) if everywhere else 0
    for _ in range(rounds):
        for k, grid in enumerate(grids):
            tried = [[*point[:k], x, *point[k + 1 :]] for x in grid]
            point = min([point, *tried], key=error)
    reach = [grid[1] - grid[0] for grid in grids]
    return values(_descended(error, point, reach, bounds))


def _descended(
    error: Callable[[Sequence[float] | FloatArray], float],
    point: list[float],
    reach: Sequence[float],
    bounds: Sequence[tuple[float, float]],
) -> list[float]:
    """Return the minimum near the best point of the grid.

    A line search over all of a parameter's range steps over a narrow valley, such as an order's, so
    each descent moves by at most one step of the grid; it restarts from its end while that improves
    the result, since a valley of two shapes is curved.
    """
    point = [min(max(x, low), high) for x, (low, high) in zip(point, bounds, strict=True)]
    left = error(point)
    for _ in range(MOST_DESCENTS):
        near = [
            (max(low, x - step), min(high, x + step))
            for x, step, (low, high) in zip(point, reach, bounds, strict=True)
        ]
        best = optimize.minimize(
            error, point, method="Powell", bounds=near, options={"xtol": 1e-4, "ftol": 1e-10}
        )
        gained, left = left - best.fun, min(left, best.fun)
        if gained > 0:
            point = [float(x) for x in best.x]
        if gained <= 1e-5 * left:
            break
    return point


def _mean_offset(problem: _Problem, shape: Sequence[float], free: FloatArray) -> float:
    """Return the mean over the runs of the residual of the free columns."""
    if problem.offset is None:
        return 0.0
    return float(np.mean([_run_offset(problem, run, shape, free) for run in problem.runs]))


def _run_offset(problem: _Problem, run: FitRun, shape: Sequence[float], free: FloatArray) -> float:
    left = run.thin[problem.model.target] - problem.columns(run, shape)[:, problem.free] @ free
    return float(left.mean() * problem.signs[problem.offset or 0])


def _bootstrap(
    problem: _Problem, free: FloatArray, shape: list[float], count: int, seed: int
) -> FloatArray | None:
    """Return values over a bootstrap of runs: (replicate, free columns + shapes + offset).

    Each replicate takes one Gauss-Newton step from the fit, with the derivative of the estimate by
    each shape, on the scale it is searched on, as a further column.
    Parameters at a bound stay there: NaN. The others stay within theirs.
    """
    runs = problem.runs
    if count == 0 or len(runs) < 2:
        return None
    names = len(free)
    products, means = [], []
    for run in runs:
        table = np.column_stack(
            [
                problem.columns(run, shape)[:, problem.free],
                _slopes(problem, run, shape, free),
                run.thin[problem.model.target]
                - problem.columns(run, shape)[:, problem.free] @ free,
            ]
        )
        means.append(table.mean(axis=0))
        if problem.model.run_offsets:
            table = table - means[-1]
        products.append(table.T @ table)
    inside = np.concatenate([(free > problem.lower) & (free < problem.upper), np.ones(len(shape))])
    moving = np.flatnonzero(inside)
    weights = np.random.default_rng(seed).multinomial(
        len(runs), np.full(len(runs), 1 / len(runs)), size=count
    )
    shapes = problem.shape_parameters
    start = np.concatenate([free, [_scaled(p, x) for p, x in zip(shapes, shape, strict=True)]])
    values = np.full((count, len(start) + 1), np.nan)
    low = np.concatenate([problem.lower, [_scaled(p, p.lower) for p in shapes]]) - start
    high = np.concatenate([problem.upper, [_scaled(p, p.upper) for p in shapes]]) - start
    for replicate, weight in enumerate(weights):
        total = np.tensordot(weight, products, axes=1)
        step = np.zeros(len(start))
        step[moving] = solve_within(
            total[np.ix_(moving, moving)], total[moving, -1], low[moving], high[moving]
        )
        values[replicate, :-1] = np.where(inside > 0, start + step, np.nan)
        if problem.offset is not None:
            mean = np.average(means, axis=0, weights=weight)
            values[replicate, -1] = (mean[-1] - mean[:-1] @ step) * problem.signs[problem.offset]
    for k, parameter in enumerate(shapes, start=names):
        if not parameter.linear:
            values[:, k] = np.exp(values[:, k])
    return values


def _slopes(problem: _Problem, run: FitRun, shape: list[float], free: FloatArray) -> FloatArray:
    """Return the derivative of the estimate by each shape on its scale, shape (n, shapes)."""
    slopes = np.empty((run.places.size, len(shape)))
    for k, parameter in enumerate(problem.shape_parameters):
        ends = []
        for sign in (1, -1):
            moved = _unscaled(parameter, _scaled(parameter, shape[k]) + sign * SLOPE_STEP)
            ends.append(
                problem.columns(run, [*shape[:k], moved, *shape[k + 1 :]])[:, problem.free] @ free
            )
        slopes[:, k] = (ends[0] - ends[1]) / (2 * SLOPE_STEP)
    return slopes


def _with_numbers(
    problem: _Problem,
    free: FloatArray,
    shape: list[float],
    offset: float,
    spreads: FloatArray | None = None,
    evidence: Evidence | None = None,
) -> Model:
    """Return the model with its numbers in place."""
    amplitudes = np.full(len(problem.names), offset)
    amplitudes[problem.free] = free
    place = np.full(len(problem.names), -1)  # the offset is the bootstrap's last column
    place[problem.free] = np.arange(len(free))
    values: list[dict[str, Estimate]] = []
    column, shape_at = 0, 0
    for term in problem.model.terms:
        own: dict[str, Estimate] = {}
        for parameter in term.effect.amplitudes:
            own[parameter.name] = _estimate(amplitudes[column], spreads, int(place[column]))
            column += 1
        for parameter in term.effect.shape:
            own[parameter.name] = _estimate(shape[shape_at], spreads, len(free) + shape_at)
            shape_at += 1
        values.append(own)
    return with_values(problem.model, values, evidence)


def _estimate(value: float, spreads: FloatArray | None, column: int) -> Estimate:
    if spreads is None or not np.isfinite(spreads[:, column]).all():
        return Estimate(float(value))
    replicates = spreads[:, column]
    return Estimate(float(value), float(replicates.std(ddof=1)), interval95(value, replicates))


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
    )


def _run_spread(fitted: Model, errors: Sequence[FloatArray]) -> float | None:
    """Return how much runs differ: the standard deviation of the logarithm of their errors."""
    powers = np.array([e.var() if fitted.run_offsets else np.mean(e**2) for e in errors])
    if len(powers) < 2 or not np.all(powers > 0):
        return None
    return float(np.std(0.5 * np.log(powers), ddof=1))
