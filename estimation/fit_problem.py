"""A model laid out for fitting: its runs, its columns, and amplitudes by least squares."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from estimation.campaign import Campaign
from estimation.derived import CAMPAIGN_TIME, measured_channels
from estimation.effects import Parameter
from estimation.errors import EstimationError
from estimation.filters import LowPass
from estimation.model import Model, Term, balance_channels, settled
from estimation.noise import white_noise
from estimation.recording import FloatArray, Recording
from estimation.within_bounds import solve_apart

OFFSET, VISCOUS, COULOMB = "sensor.offset", "friction.viscous", "friction.coulomb"

NARROWEST = 1e-3
"""Speed over which friction changes its sign that is searched, of the usual most speed."""


MANY_FLAGGED = 0.1
"""Share of flagged samples in a run from which they may be why none counts."""


CONSTANT = 1e-9
"""Range of a target, relative to its size, below which it is constant but for rounding."""


class FitError(EstimationError):
    """The model's parameters are not identifiable from the campaign."""


@dataclass(frozen=True)
class FitRun:
    """A run's filtered channels, whole for effects with memory, and the samples of the fit."""

    whole: Recording
    places: NDArray[np.intp]
    thin: Recording
    low_pass: LowPass

    def columns(
        self, term: Term, shape: Sequence[float], places: NDArray[np.intp] | None = None
    ) -> FloatArray:
        """Return an effect's columns at samples of the run, by default at those of the fit."""
        if term.effect.start():  # it depends on the samples between
            return np.asarray(
                term.columns(self.whole, shape)[self.places if places is None else places]
            )
        some = self.thin if places is None or places is self.places else self.whole.at(places)
        return term.columns(some, shape, self.low_pass)


@dataclass(frozen=True)
class Problem:
    """A model laid out for fitting: its runs and which columns are which."""

    model: Model
    runs: list[FitRun]
    free: NDArray[np.intp]  # columns that least squares solves for
    offset: int | None  # column of the model's own offset when run offsets replace it
    same: tuple[int, int] | None  # columns of Coulomb friction and of an offset that are one
    names: list[str]  # of all columns
    shape_parameters: list[Parameter]  # of all terms, in order
    signs: FloatArray
    lower: FloatArray
    upper: FloatArray
    kept: dict[tuple[int, int], tuple[list[float], FloatArray]] = field(default_factory=dict)
    """Each run's and term's last shape and columns: a search moves one term's shape at a time."""

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

    def free_columns(self, run: FitRun, shape: Sequence[float]) -> FloatArray:
        """Return the columns of a run that least squares solves for, shape (n, free)."""
        return self.columns(run, shape)[:, self.free]

    def gram(self, run: FitRun, shape: Sequence[float]) -> FloatArray:
        """Return the cross-products of free columns and target of one run."""
        table = np.column_stack([self.free_columns(run, shape), run.thin[self.model.target]])
        if self.model.run_offsets:
            table -= table.mean(axis=0)
        product: FloatArray = table.T @ table
        return product


def prepared(model: Model, campaign: Campaign, every: int | None = None) -> list[FitRun]:
    """Read the runs and find every n-th valid sample of them that a fit counts.

    By default n is as large as four times the filter's cutoff allows.

    Raises:
        FitError: No valid sample.
        MissingChannelError: A run lacks a channel of the model.
    """
    runs = []
    for recording in _timed(model, campaign).evidence:
        step = every or max(1, int(recording.sample_rate_hz / (4 * model.low_pass.cutoff_hz)))
        whole = balance_channels(model, recording)
        places = settled(model, whole, step)
        if places.size:
            runs.append(FitRun(whole, places, whole.at(places), model.low_pass))
    if not runs:
        longest_s = max((recording.duration_s for recording in campaign.evidence), default=0.0)
        if 0.0 < longest_s < model.low_pass.reach_s:
            raise FitError(
                f"No valid samples to fit model {model.name!r}.",
                f"The longest run lasts {longest_s:.3g} s, and the filter reaches"
                f" {model.low_pass.reach_s:.3g} s from each end of it.",
                "Correct the unit of time_s in the machine's file, or record longer runs.",
            )
        flagged = [1.0 - float(recording.valid.mean()) for recording in campaign.evidence]
        raise FitError(
            f"No valid samples to fit model {model.name!r}.",
            f"{len(campaign)} runs, {len(campaign.evidence)} of them not excluded, with"
            f" {float(np.mean(flagged or [0.0])):.0%} of their samples flagged; static samples do"
            " not count where friction is fitted, nor those near flagged ones.",
            "Record runs in which the rig moves."
            if max(flagged, default=0.0) < MANY_FLAGGED
            else "Look at why samples are flagged: rig import DATA --machine FILE --preview.",
        )
    return runs


def _timed(model: Model, campaign: Campaign) -> Campaign:
    """Return the campaign with its time where the model reads it."""
    return campaign.timed() if CAMPAIGN_TIME in model.channels else campaign


def noisier(model: Model, campaign: Campaign, runs: Sequence[FitRun]) -> list[FitRun]:
    """Return prepared runs once more, with each reading's noise added to it a second time.

    The readings are those of the columns, and the samples are the same. How the amplitudes move is
    how far the noise that is there has moved them (Cook and Stefanski 1994, simulation
    extrapolation).
    """
    places, out = {run.whole.name: run.places for run in runs}, []
    for recording in _timed(model, campaign).evidence:
        if recording.name in places:
            read = [c for c in measured_channels(model.channels, model.signals) if c in recording]
            noise = white_noise(recording, read, model.signals)
            doubled = recording.with_columns(**{c: recording[c] + noise[c] for c in read})
            whole, at = balance_channels(model, doubled), places[recording.name]
            out.append(FitRun(whole, at, whole.at(at), model.low_pass))
    return out


def problem_of(model: Model, runs: list[FitRun]) -> Problem:
    """Return a model laid out on prepared runs."""
    parameters = [(term, p) for term in model.terms for p in term.effect.amplitudes]
    names = [f"{term.effect.id}.{p.name}" for term, p in parameters]
    offset = names.index(f"{OFFSET}.offset") if f"{OFFSET}.offset" in names else None
    replaced = offset if model.run_offsets else None
    free = np.array([k for k in range(len(names)) if k != replaced], dtype=np.intp)
    return Problem(
        model=model,
        runs=runs,
        free=free,
        offset=replaced,
        same=None if model.run_offsets else one_constant(model.terms, runs),
        names=names,
        shape_parameters=[p for term in model.terms for p in _shapes(term, model, runs)],
        signs=np.array([float(term.sign) for term, _ in parameters]),
        lower=np.array([p.lower for _, p in parameters])[free],
        upper=np.array([p.upper for _, p in parameters])[free],
    )


def one_constant(terms: Sequence[Term], runs: Sequence[FitRun]) -> tuple[int, int] | None:
    """Return the amplitudes of Coulomb friction and of an offset that are one constant, if any.

    They are so where the speed never changes its sign: noise alone would decide their difference.
    """
    names = [term.effect.id for term in terms for _ in term.effect.amplitudes]
    if names.count(COULOMB) != 1 or OFFSET not in names:
        return None
    channel = next(term.channels["speed"] for term in terms if term.effect.id == COULOMB)
    speed = np.concatenate([run.thin[channel] for run in runs])
    if speed.min() <= 0.0 <= speed.max():
        return None
    return names.index(COULOMB), names.index(OFFSET)


def _shapes(term: Term, model: Model, runs: Sequence[FitRun]) -> list[Parameter]:
    """Return a term's shape parameters, a width of a change of sign within that of these runs.

    Where the speed never changes its sign nothing shows the width: it is then below every speed,
    since a wider one takes the form of what friction does at speed. In a model without viscous
    friction that form is the width's own.
    """
    channel = term.channels.get("speed")
    viscous = {t.channels["speed"] for t in model.terms if t.effect.id == VISCOUS}
    if channel is None or channel not in viscous:
        return [*term.effect.shape]
    speed = np.concatenate([run.thin[channel] for run in runs])
    least, usual = np.percentile(np.abs(speed), [1.0, 95.0]).tolist()
    widest = usual if speed.min() < 0.0 < speed.max() else least
    out = []
    for p in term.effect.shape:
        if p.name == "width" and widest > 0.0:
            low = min(p.lower, NARROWEST * widest)
            out.append(replace(p, lower=low, upper=min(p.upper, max(widest, p.lower))))
        else:
            out.append(p)
    return out


def solve(problem: Problem, gram: FloatArray) -> FloatArray:
    """Return the amplitudes of the free columns within their bounds."""
    if problem.free.size == 0:
        return np.empty(0)
    kept = [k for k in range(len(gram) - 1) if problem.same is None or k != problem.same[1]]
    inner = gram[np.ix_(kept, kept)]
    scale = np.sqrt(np.maximum(np.diag(inner), np.finfo(float).tiny))
    _check_independent(problem, inner / np.outer(scale, scale), np.diag(inner), kept)
    bounds = problem.lower, problem.upper
    return solve_apart(gram[:-1, :-1], gram[:-1, -1], *bounds, problem.same)


def check_target(problem: Problem) -> None:
    """Refuse a target that does not vary where effects are declared: an offset alone fits it.

    Raises:
        FitError: It is constant; in each run, where runs have offsets of their own.
    """
    if all(term.effect.id == OFFSET for term in problem.model.terms):
        return
    target = problem.model.target
    values = [run.thin[target] for run in problem.runs]
    parts = values if problem.model.run_offsets else [np.concatenate(values)]
    if problem.free.size and all(np.ptp(x) <= CONSTANT * np.abs(x).max() for x in parts):
        raise FitError(
            f"{target} is constant at {float(values[0][0]):.4g} {problem.model.unit}, so no effect"
            f" can be identified in the equation {problem.model.balance}.",
            "A sensor that is stuck or not connected reads so.",
            "Check the sensor and its column, or record runs in which it varies.",
        )


def _check_independent(
    problem: Problem, normal: FloatArray, power: FloatArray, places: Sequence[int]
) -> None:
    values, vectors = np.linalg.eigh(normal)
    if np.all(power > 0) and values[0] > 1e-10:
        return
    guilty = np.abs(vectors[:, 0]) > 0.1 if np.all(power > 0) else power <= 0
    named = ", ".join(problem.names[k] for k in problem.free[places][guilty])
    raise FitError(
        f"{named} cannot be identified from these runs.",
        "The columns are constant or proportional to one another in every run.",
        "Take an effect out of the model, or record runs that excite it.",
    )
