"""The held-out test runs of a diagnosis: signals for its charts, and errors of the written models.

They are those that the reported errors are made of: the same samples, the same refitted equations.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime

import numpy as np

from estimation.causes.findings import BY_CHANNEL, OTHER_ROLES, VARIABLE_OF_ROLE, Kept
from estimation.causes.functions import Function
from estimation.causes.verdict import Answer
from estimation.cross_validation import live_half_width
from estimation.derived import zero_phase_channels
from estimation.model import Model, counted_error, predict
from estimation.recording import FloatArray, Recording
from estimation.scores import rmse


@dataclass(frozen=True)
class RunTrace:
    """One held-out test run in one equation, at the samples that its error counts.

    Attributes:
        run: Name of the run.
        time_s: Time since the run began, shape (n,), s.
        measured: The target, zero-phase filtered, shape (n,).
        before: Measured less estimated with the declared model, its mean removed, shape (n,).
        after: The same with the findings.
        channels: Channels that the findings read, shape (n,) each.
    """

    run: str
    time_s: FloatArray
    measured: FloatArray
    before: FloatArray
    after: FloatArray
    channels: Mapping[str, FloatArray]


@dataclass(frozen=True)
class EquationTraces:
    """The held-out test runs, in the order of the campaign, in one declared equation."""

    model: Model
    runs: tuple[RunTrace, ...]


@dataclass(frozen=True)
class Traces:
    """What the charts of a diagnosis are drawn from.

    Attributes:
        equations: Equation to its runs; those without a sample are left out.
        over: For each finding the channels that its residual is drawn over.
    """

    equations: Mapping[str, EquationTraces]
    over: tuple[tuple[str, ...], ...]


def traces(answer: Answer) -> Traces:
    """Return the traces of a diagnosis."""
    over = tuple(_channels(kept) for kept in answer.kept)
    wanted: dict[str, list[str]] = {name: [] for name in answer.refits.of}
    for finding, channels in zip(answer.diagnosis.findings, over, strict=False):
        wanted[finding.balance] += channels
    found = {name: _equation(answer, name, channels) for name, channels in wanted.items()}
    return Traces({name: one for name, one in found.items() if one.runs}, over)


def _equation(answer: Answer, name: str, wanted: list[str]) -> EquationTraces:
    refit = answer.refits.of[name]
    before, after = answer.refits.before(name), answer.refits.after(name)
    runs = []
    for run in refit.test_names:
        sides = [refit.residuals(solved, run) for solved in (before, after)]
        if sides[0] is None or sides[1] is None:
            continue
        (places, _, old), (_, measured, new) = sides[0], sides[1]
        clock = refit.recordings[run].time_s
        # a cause that no model file holds is no term of the equation: its channels are read here
        read = {}
        if wanted:
            filtered = zero_phase_channels(
                refit.recordings[run], wanted, refit.model.low_pass, refit.model.signals
            )
            read = {channel: filtered[channel][places] for channel in wanted}
        time_s = clock[places] - clock[0]
        runs.append(RunTrace(run, time_s, measured, old - old.mean(), new - new.mean(), read))
    return EquationTraces(refit.model, tuple(runs))


def _channels(kept: Kept, most: int = 2) -> tuple[str, ...]:
    """Return the first channels of a cause's variables, time left out."""
    cause = kept.scored.candidate.cause
    if isinstance(cause, Function):
        read: Sequence[str] = cause.reads
    else:
        named = (*BY_CHANNEL, *OTHER_ROLES, *VARIABLE_OF_ROLE)
        read = [channel for role, channel in cause.channels if role in named]
    return tuple(dict.fromkeys(c for c in read if c != "time_s"))[:most]


def with_cost_of_causal_filters(found: Answer) -> Answer:
    """Return the diagnosis with the error of each written model with causal filters.

    A note states it next to that of zero-phase filters. Both estimates are compared with the target
    as the zero-phase filter gives it, on the test runs, each run's mean removed, where the equation
    counts. The error that a replay shows has none of that, and may be far larger: it is stated too.
    The models contain their interval live, and their date.
    """
    notes, models = [], []
    now = datetime.now(UTC).isoformat(timespec="seconds")
    for model in found.models:
        refit = found.refits.of[model.balance]
        runs = [refit.recordings[name] for name in refit.test_names]
        errors = [[counted_error(model, run, causal) for run in runs] for causal in (False, True)]
        zero_phase, causal = (_spread(one) for one in errors)
        small = model.unit == "N m" and causal < 1.0
        scale, unit = (1e3, "mN m") if small else (1.0, model.unit)
        notes.append(
            f"{model.balance}: the written model has an error of {scale * zero_phase:.3g} {unit} on"
            f" the test runs with zero-phase filters and {scale * causal:.3g} {unit} with the"
            f" causal ones it runs with live ({causal / max(zero_phase, 1e-300):.2f} times as"
            " much)."
        )
        if shown := [error for run in runs for error in _as_shown(model, run)]:
            at_rest = "at reversals and standstill too, " * (model.samples == "motion")
            notes[-1] += (
                f" Next to {model.target} as it is read, {at_rest}with the delay of these filters,"
                f" it is {scale * rmse(np.concatenate(shown), 0.0):.3g} {unit}: a replay shows it."
            )
        half_width = live_half_width(errors[1])
        evidence = model.evidence and replace(model.evidence, made_at=now, half_width=half_width)
        models.append(replace(model, evidence=evidence))
    diagnosis = replace(found.diagnosis, notes=(*found.diagnosis.notes, *notes))
    return replace(found, diagnosis=diagnosis, models=tuple(models))


def _as_shown(model: Model, run: Recording) -> Iterator[FloatArray]:
    """Yield the error that a replay of a run shows; nothing where its target is not recorded."""
    if model.target in run:
        settled = np.cumsum(run.valid) > 2.0 * model.low_pass.reach_s * run.sample_rate_hz
        error = run[model.target] - predict(model, run, causal=True)
        yield error[settled & run.valid & np.isfinite(error)]


def _spread(errors: Sequence[FloatArray]) -> float:
    """Return the root mean square of the errors of runs, each run's mean removed."""
    known = [error[np.isfinite(error)] for error in errors]
    centred = [error - error.mean() for error in known if error.size]
    return rmse(np.concatenate(centred), 0.0) if centred else 0.0
