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
from scipy import linalg

from estimation.causes.equations import Layout, LayoutError, RunSignals, laid_out_like
from estimation.causes.functions import Function, names
from estimation.causes.instruments import add_instruments
from estimation.causes.search import Candidate, Scored
from estimation.causes.sources import Source
from estimation.causes.terms import plain
from estimation.causes.verdict import IN_SET, Answer, Kept
from estimation.recording import FloatArray, Recording

MOST = 4
"""Hypotheses that are compared at most."""


@dataclass(frozen=True)
class Hypothesis:
    """One explanation of a finding.

    Attributes:
        label: Its family, or the variables of an unknown form.
        probability: Its probability among those compared.
        cause: The cause.
        amplitudes: Fitted on the training runs together with the other causes, shape (k,).
    """

    label: str
    probability: float
    cause: Source | Function
    amplitudes: FloatArray


@dataclass(frozen=True)
class Question:
    """The hypotheses of one finding, ready to predict.

    Attributes:
        hypotheses: Two at least.
        noise: Equation to the variance of its residual with the likeliest hypothesis.
        layout: The equations.
    """

    hypotheses: tuple[Hypothesis, ...]
    noise: Mapping[str, float]
    layout: Layout


def question(answer: Answer, place: int) -> Question | None:
    """Return the hypotheses that an experiment should separate; None where the name is sure.

    Args:
        answer: The diagnosis.
        place: Place of the finding.
    """
    if answer.diagnosis.findings[place].verdict == "identified":
        return None
    likely = _likely(answer.kept[place], answer.refits.numbers.sharpness)
    if len(likely) < 2:
        return None
    train = answer.layout.select(answer.diagnosis.sealed.discover)
    others = [k.scored.candidate for i, k in enumerate(answer.kept) if i != place]
    total = sum(share for share, _ in likely)
    found, noise = [], None
    for share, one in likely:
        amplitudes, left = _fitted(train, others, one.candidate)
        noise = noise or left
        cause = plain(one.candidate.cause)
        found.append(Hypothesis(_label(one), share / total, cause, amplitudes))
    return Question(tuple(found), noise or {}, answer.layout)


def separation(asked: Question, recordings: Sequence[Recording]) -> float | None:
    """Return the expected distance of the hypotheses on simulated runs, in variances of the noise.

    Args:
        asked: The hypotheses.
        recordings: Simulated runs of one experiment, with the campaign's time.

    Returns:
        None where no run has a sample of the equations.
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


def _likely(kept: Kept, sharpness: float) -> list[tuple[float, Scored]]:
    """Return the likeliest hypotheses in a finding's place with their probabilities, best first."""
    scores = np.array([s.score for s in kept.ranked])
    weights = np.exp(sharpness * (scores - scores.max()))
    shares: dict[str, float] = {}
    best: dict[str, Scored] = {}
    for scored, weight in zip(kept.ranked, weights / weights.sum(), strict=True):
        label = _label(scored)
        shares[label] = shares.get(label, 0.0) + float(weight)
        best.setdefault(label, scored)
    ordered = sorted(shares, key=lambda label: -shares[label])
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


def _fitted(
    train: Layout, others: Sequence[Candidate], one: Candidate
) -> tuple[FloatArray, dict[str, float]]:
    """Fit a cause with the declared terms and other causes on all equations together.

    Returns:
        Its amplitudes, shape (k,), and the variance of each equation's residual.
    """
    blocks, aims, sizes = [], [], {}
    for name, equation in train.equations.items():
        rows, aim = [], []
        for k, run in enumerate(train.runs):
            used = run.grid[run.used[name]]
            own = [_acting(c, k, run, name) for c in (*others, one)]
            rows.append(np.hstack([equation.columns(run.channels)[used], *own]))
            aim.append(run.channels[equation.target][used])
            rows[-1], aim[-1] = rows[-1] - rows[-1].mean(axis=0), aim[-1] - aim[-1].mean()
        table, target = np.vstack(rows), np.concatenate(aim)
        width = equation.columns(train.runs[0].channels).shape[1]
        left = target - table @ np.linalg.lstsq(table, target, rcond=1e-8)[0]
        sizes[name] = float(np.mean(left**2))
        # every equation has its own declared terms, and all share the causes
        scale = 1.0 / np.sqrt(max(sizes[name], 1e-300))
        blocks.append((table[:, :width] * scale, table[:, width:] * scale))
        aims.append(target * scale)
        count = own[-1].shape[1]
    declared = linalg.block_diag(*(own for own, _ in blocks))
    whole = np.hstack([declared, np.vstack([shared for _, shared in blocks])])
    weights = np.linalg.lstsq(whole, np.concatenate(aims), rcond=1e-6)[0]
    return np.asarray(weights[-count:]), sizes


def _acting(candidate: Candidate, k: int, run: RunSignals, equation: str) -> FloatArray:
    """Return a cause's columns in one equation of the k-th training run, (n, width)."""
    columns = plain(candidate.cause).columns(run) or {}
    width = next(x.shape[1] for x in columns.values())
    acts = candidate.acts is None or candidate.acts[k]
    if equation not in columns or not acts:
        return np.zeros((len(run.used[equation]), width))
    return columns[equation]


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
