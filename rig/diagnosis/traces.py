"""The held-out test runs of a diagnosis: signals for its charts, and errors of the written models.

They are those that the reported errors are made of: the same samples, the same refitted equations.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime

import numpy as np

from estimation.causes.findings import ANGLES_OF_ROLE, VARIABLE_OF_ROLE, Kept
from estimation.causes.functions import Function
from estimation.causes.refit import Refit
from estimation.causes.verdict import Answer
from estimation.derived import zero_phase_channels
from estimation.model import Model, predict
from estimation.recording import FloatArray


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
            filtered = zero_phase_channels(refit.recordings[run], wanted, refit.model.low_pass)
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
        named = (*ANGLES_OF_ROLE, *VARIABLE_OF_ROLE)
        read = [channel for role, channel in cause.channels if role in named]
    return tuple(dict.fromkeys(c for c in read if c != "time_s"))[:most]


def with_cost_of_causal_filters(found: Answer) -> Answer:
    """Return the diagnosis with a note on the error of each written model with causal filters.

    Both estimates are compared with the target as the zero-phase filter gives it, on the test runs,
    over the samples that reported errors count, each run's mean removed.
    """
    notes = []
    for model in found.models:
        zero_phase, causal = _held_out_errors(model, found.refits.of[model.balance])
        small = model.unit == "N m" and causal < 1.0
        scale, unit = (1e3, "mN m") if small else (1.0, model.unit)
        notes.append(
            f"{model.balance}: the written model has an error of {scale * zero_phase:.3g} {unit} on"
            f" the test runs with zero-phase filters and {scale * causal:.3g} {unit} with the"
            f" causal ones it runs with live ({causal / max(zero_phase, 1e-300):.2f} times as"
            " much)."
        )
    diagnosis = replace(found.diagnosis, notes=(*found.diagnosis.notes, *notes))
    return replace(found, diagnosis=diagnosis)


def written_models(found: Answer) -> list[Model]:
    """Return the models with the causes found, each with its date and its errors.

    A watch then has from the first run on the usual error, and a display the uncertainty of an
    estimate.
    """
    now = datetime.now(UTC).isoformat(timespec="seconds")
    return [
        replace(model, evidence=model.evidence and replace(model.evidence, made_at=now))
        for model in found.models
    ]


def _held_out_errors(model: Model, refit: Refit) -> tuple[float, float]:
    """Return a model's root mean square errors on the test runs: zero-phase, then causal."""
    squares, samples = np.zeros(2), 0
    for name in refit.test_names:
        counted = refit.residuals(refit.solve([]), name)
        if counted is None:
            continue
        places, recording = counted[0], refit.recordings[name]
        filtered = zero_phase_channels(recording, [model.target], model.low_pass, model.signals)
        target = filtered[model.target]
        both = np.array([target - predict(model, recording, causal) for causal in (False, True)])
        known = both[:, places][:, np.isfinite(both[:, places]).all(axis=0)]
        squares += np.sum((known - known.mean(axis=1, keepdims=True)) ** 2, axis=1)
        samples += known.shape[1]
    zero_phase, live = np.sqrt(squares / max(samples, 1))
    return float(zero_phase), float(live)
