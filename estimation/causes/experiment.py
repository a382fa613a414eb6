"""How well an experiment would separate the hypotheses of a finding, before it is recorded.

The simulated rig, without the cause, plays the experiment; its closed loop follows the reference
almost equally with and without it. Each hypothesis, fitted on the training runs, predicts its
contribution to every equation there. Two hypotheses are as far apart as the mean square of the
difference of their contributions over the variance of the noise, after the declared terms have
absorbed what they can: a Mahalanobis distance. Pairs are weighted by their probabilities.
"""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from estimation.causes.criterion import base_errors
from estimation.causes.findings import IN_SET, Kept
from estimation.causes.functions import Function, names
from estimation.causes.instruments import add_instruments
from estimation.causes.layout import Layout, laid_out_like
from estimation.causes.numbers import Numbers
from estimation.causes.run_signals import LayoutError
from estimation.causes.scoring import Scored, posterior
from estimation.causes.sources import Source
from estimation.causes.verdict import Answer
from estimation.recording import FloatArray, Recording

MOST = 4
"""Hypotheses that are compared at most."""


@dataclass(frozen=True)
class Hypothesis:
    """One explanation of a finding, with its probability among those compared.

    Its amplitudes, shape (k,), were fitted on the training runs together with the other causes.
    """

    label: str
    probability: float
    cause: Source | Function
    amplitudes: FloatArray


@dataclass(frozen=True)
class Question:
    """Two hypotheses of one finding at least, ready to predict.

    The noise is, for each equation, the variance of its residual with the likeliest one, on runs
    left out.
    """

    hypotheses: tuple[Hypothesis, ...]
    noise: Mapping[str, float]
    layout: Layout


def question(answer: Answer, place: int) -> Question | None:
    """Return the hypotheses of a finding that an experiment should separate; None if it is sure."""
    if answer.diagnosis.findings[place].verdict == "identified":
        return None
    joint = answer.found.joint
    for k, other in enumerate(answer.kept):
        if k != place:
            joint = joint.with_cause(other.scored.candidate.laid, other.scored.candidate.precision)
    likely = _likely(answer.kept[place], joint.numbers)
    if len(likely) < 2:
        return None
    leading = likely[0][1].candidate
    best = joint.with_cause(leading.laid, leading.precision)
    (errors,) = base_errors(best, [[[k] for k in range(len(joint.runs))]])
    noise = {
        name: float(errors[name, "within"].sum() / joint.samples[name, "within"].sum())
        for name in joint.layout.equations
    }
    total = sum(share for share, _ in likely)
    found = tuple(
        Hypothesis(
            _label(one), share / total, one.candidate.cause, one.amplitudes / one.candidate.size
        )
        for share, one in likely
    )
    return Question(found, noise, answer.layout)


def separation(asked: Question, recordings: Sequence[Recording]) -> float | None:
    """Return the expected distance of the hypotheses on simulated runs, in variances of the noise.

    The runs are of one experiment and have the campaign's time; None where none has a sample of the
    equations.
    """
    try:
        layout = laid_out_like(asked.layout, recordings)
    except LayoutError:
        return None
    add_instruments(layout, [run.name for run in layout.runs])
    total, weight = 0.0, 0.0
    predicted = [_predicted(one, layout) for one in asked.hypotheses]
    pairs = itertools.combinations(zip(asked.hypotheses, predicted, strict=True), 2)
    for (one, first), (other, second) in pairs:
        share = one.probability * other.probability
        apart = 0.0
        for name in {*first, *second}:
            difference = first.get(name, 0.0) - second.get(name, 0.0)
            apart += float(np.mean(np.square(difference))) / max(asked.noise[name], 1e-300)
        total, weight = total + share * apart, weight + share
    return total / weight


def _likely(kept: Kept, numbers: Numbers) -> list[tuple[float, Scored]]:
    """Return the likeliest hypotheses in a finding's place with their probabilities, best first.

    A family has the probability that the finding states, from all runs. That of an unknown form is
    shared by its sets of variables as the training runs share it.
    """
    shares: dict[str, float] = {}
    best: dict[str, Scored] = {}
    for family in kept.likely:
        forms = [s for s in kept.ranked if s.candidate.cause.family == family.family]
        weights = posterior(forms, numbers)
        for scored, weight in zip(forms, weights / weights.sum(), strict=True):
            label = _label(scored)
            shares[label] = shares.get(label, 0.0) + family.share * float(weight)
            best.setdefault(label, scored)
    ordered = sorted((x for x in shares if shares[x] > 0.0), key=lambda label: -shares[label])
    covered, out = 0.0, []
    for label in ordered[:MOST]:
        out.append((shares[label], best[label]))
        covered += shares[label]
        if covered >= IN_SET and len(out) > 1:
            break
    return out


def _label(scored: Scored) -> str:
    cause = scored.candidate.cause
    if isinstance(cause, Source):
        return cause.family
    return f"a function of {' and '.join(names(cause.place, cause.variables))}"


def _predicted(one: Hypothesis, layout: Layout) -> Mapping[str, FloatArray]:
    """Return the contribution to each equation beyond what declared terms absorb, (samples,)."""
    made: dict[str, list[FloatArray]] = {}
    declared: dict[str, list[FloatArray]] = {}
    for run in layout.runs:
        for name, columns in (one.cause.columns(run) or {}).items():
            equation = layout.equations[name]
            used = run.grid[run.used[name]]
            base = equation.columns(run.channels)[used]
            value = columns @ one.amplitudes
            made.setdefault(name, []).append(value - value.mean())
            declared.setdefault(name, []).append(base - base.mean(axis=0))
    out = {}
    for name, values in made.items():
        aim, base = np.concatenate(values), np.vstack(declared[name])
        out[name] = aim - base @ np.linalg.lstsq(base, aim, rcond=1e-10)[0]
    return out
