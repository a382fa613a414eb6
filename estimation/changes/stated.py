"""A change that was found, with its names, its size and an interval over runs."""

from collections.abc import Mapping, Sequence

import numpy as np

from estimation.causes.candidates import Group
from estimation.causes.equations import Layout
from estimation.causes.joint import Joint
from estimation.causes.numbers import Numbers
from estimation.causes.scoring import Scored, probabilities
from estimation.causes.sources import Source
from estimation.changes.candidates import Moved, SensorGain
from estimation.changes.difference import Change
from estimation.channels import unit_of
from estimation.fit_problem import OFFSET
from estimation.recording import FloatArray
from estimation.units import evaluate

SURE, IN_SET = 0.9, 0.95
"""Probability from which a single name is given, and that a set of names covers."""

REPLICATES = 200
"""Resampled sets of runs, for intervals."""


def prior_of_moved(pool: Sequence[Group], numbers: Numbers) -> float:
    """Return the score by which a moved parameter is likelier than an effect that came or went.

    Either kind of change is as likely; the names of one kind share its probability.
    """
    names: dict[bool, set[tuple[str, str]]] = {True: set(), False: set()}
    for group in pool:
        for one in group.candidates:
            names[isinstance(one.cause, Moved)].add((one.cause.place.name, one.cause.family))
    return float(np.log(max(1, len(names[False])) / max(1, len(names[True]))) / numbers.sharpness)


def shares(ranked: Sequence[Scored], prior: float, numbers: Numbers) -> dict[str, float]:
    """Return the probability of each name, the likeliest first."""
    more = [prior if isinstance(_source(one), Moved) else 0.0 for one in ranked]
    scores, gains = np.array([(s.score + m, s.gain) for s, m in zip(ranked, more, strict=True)]).T
    each = probabilities(scores, gains, numbers.sharpness)
    found = {_key(one): float(p) for one, p in zip(ranked, each, strict=True)}
    return dict(sorted(found.items(), key=lambda pair: -pair[1]))


def stated(
    one: Scored,
    probability: Mapping[str, float],
    joint: Joint,
    causes: Sequence[Scored],
    random: np.random.Generator,
) -> Change:
    """Return a change as it is reported, next to all others.

    Args:
        one: The change.
        probability: Name to probability of what competes in its place, the likeliest first.
        joint: The regression without changes.
        causes: All changes that were found.
        random: Draws the runs of its interval.
    """
    name = _key(one)
    covered, others = probability[name], list[str]()
    for other, share in probability.items():
        if other != name and covered < (IN_SET if others else SURE) * sum(probability.values()):
            others.append(other)
            covered += share
    source, acts = _source(one), one.candidate.acts
    assert acts is not None  # noqa: S101 - every candidate acts in the runs of one campaign
    verdict = "moved" if isinstance(source, Moved) else ("came" if acts[-1] else "went")
    grown, labels = _grown(one, joint, causes), _labels(source, joint.layout)
    base = grown.fitted_on(np.ones(len(grown.runs)))
    low, high = np.percentile(_spread(one, grown, random), [2.5, 97.5], axis=0)
    values = base[-len(labels) :] / one.candidate.size[: len(labels)]
    before: float | None = None
    if isinstance(source, Moved):
        is_gain = isinstance(source.effect, SensorGain)
        # an offset of all runs and one of some are laid out without what they share
        shared = float(values[0] * np.mean(acts)) if source.effect.id == OFFSET else 0.0
        before = (
            1.0 if is_gain else grown.parameter(base, source.place.home, source.column) - shared
        )
    return Change(
        verdict=verdict if probability[name] >= SURE else "one_of",
        name=name,
        equation=source.place.home,
        family=source.effect.id if isinstance(source, Moved) else source.family,
        alternatives=tuple(others),
        confidence=round(probability[name], 4),
        parameters={label: float(v) for (label, _), v in zip(labels, values, strict=True)},
        ci95={
            label: (min(float(a), float(v)), max(float(b), float(v)))
            for (label, _), a, b, v in zip(labels, low, high, values, strict=True)
        },
        unit=dict(labels),
        before={label: before for label, _ in labels},
    )


def _grown(one: Scored, joint: Joint, causes: Sequence[Scored]) -> Joint:
    """Return the regression with all changes in its base, this one last."""
    for cause in (*(c for c in causes if c is not one), one):
        joint = joint.with_cause(cause.candidate.laid, cause.candidate.precision)
    return joint


def _spread(one: Scored, grown: Joint, random: np.random.Generator) -> FloatArray:
    """Return a change's amplitudes, SI, in resampled sets of the runs of each campaign."""
    size = one.candidate.size
    sides = [np.flatnonzero(np.array(one.candidate.acts) == side) for side in (True, False)]
    spread = []
    for _ in range(REPLICATES):
        counts = np.zeros(len(grown.runs))
        for side in sides:
            np.add.at(counts, random.choice(side, len(side)), 1.0)
        spread.append(grown.fitted_on(counts)[-len(size) :] / size)
    return np.array(spread)


def _labels(source: Source, layout: Layout) -> list[tuple[str, str]]:
    """Return name and unit of each amplitude."""
    target = layout.equations[source.place.home].target
    symbols = {"target": unit_of(target)} | {r: unit_of(n) for r, n in source.channels}
    chosen = [source.effect.amplitudes[k] for k in source.parts]
    return [(one.name, evaluate(one.unit, symbols)) for one in chosen]


def _source(one: Scored) -> Source:
    cause = one.candidate.cause
    assert isinstance(cause, Source)  # noqa: S101 - no candidate here has an unknown form
    return cause


def _key(one: Scored) -> str:
    """Return the name of a change in a report."""
    source = _source(one)
    return source.key if isinstance(source, Moved) else f"{source.family} at {source.place.name}"
