"""Measured signals of the held-out test runs and the residuals before and after, for a page.

They are those that the reported errors are made of: the same samples, the same refitted equations.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from estimation.causes.findings import VARIABLE_OF_ROLE, Kept
from estimation.causes.functions import Function
from estimation.causes.verdict import Answer
from estimation.derived import zero_phase_channels
from estimation.model import Model
from estimation.recording import FloatArray

MOST = 2
"""Most channels that the residual of one finding is drawn over."""


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
    """The held-out test runs in one equation.

    Attributes:
        model: The declared model.
        runs: The runs, in the order of the campaign.
    """

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
        measured = refit.channel(after, run, refit.model.target)
        if sides[0] is None or sides[1] is None or measured is None:
            continue
        (places, old), (_, new) = sides[0], sides[1]
        clock = refit.recordings[run].time_s
        # a cause that no model file holds is no term of the equation: its channels are read here
        read = {}
        if wanted:
            filtered = zero_phase_channels(refit.recordings[run], wanted, refit.model.low_pass)
            read = {channel: filtered[channel][places] for channel in wanted}
        time_s = clock[places] - clock[0]
        runs.append(RunTrace(run, time_s, measured, old - old.mean(), new - new.mean(), read))
    return EquationTraces(refit.model, tuple(runs))


def _channels(kept: Kept) -> tuple[str, ...]:
    """Return the channels of a cause's variables, time left out."""
    cause = kept.scored.candidate.cause
    if isinstance(cause, Function):
        roles = list(cause.reads)
    else:
        roles = [channel for role, channel in cause.channels if role in VARIABLE_OF_ROLE]
    return tuple(dict.fromkeys(c for c in roles if c != "time_s"))[:MOST]
