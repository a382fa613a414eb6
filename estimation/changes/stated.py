"""A change that was found, with its names, its size and an interval over runs."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import minimize_scalar

from estimation.causes.candidates import Candidate, Claim, Group, laid_out
from estimation.causes.findings import SURE, others_in_set, variables_of
from estimation.causes.functions import Function
from estimation.causes.grids import order_step
from estimation.causes.joint import Joint
from estimation.causes.numbers import Numbers
from estimation.causes.scoring import Scored, probabilities
from estimation.causes.sources import Source
from estimation.changes.candidates import Changed
from estimation.changes.difference import Change
from estimation.fit_problem import OFFSET
from estimation.model import Term
from estimation.recording import FloatArray


def prior_of_moved(pool: Sequence[Group], numbers: Numbers) -> float:
    """Return the score by which a moved parameter is likelier than an effect that came or went.

    Either kind of change is as likely; the names of one kind share its probability.
    """
    names: dict[bool, set[tuple[str, str]]] = {True: set(), False: set()}
    for group in pool:
        for one in group.candidates:
            names[isinstance(one.cause, Changed)].add((one.cause.place.name, one.cause.family))
    return float(np.log(max(1, len(names[False])) / max(1, len(names[True]))) / numbers.sharpness)


def score_of(one: Scored, prior: float) -> float:
    """Return the score of a change, a moved parameter's more by `prior`."""
    return one.score + (prior if isinstance(one.candidate.cause, Changed) else 0.0)


def likeliest_first(ranked: Sequence[Scored], prior: float) -> list[Scored]:
    """Return changes in the order of their scores with the prior."""
    return sorted(ranked, key=lambda one: -score_of(one, prior))


def shares(ranked: Sequence[Scored], prior: float, numbers: Numbers) -> dict[str, float]:
    """Return the probability of each name, the likeliest first."""
    scores, gains = np.array([(score_of(one, prior), one.gain) for one in ranked]).T
    each = probabilities(scores, gains, numbers.sharpness)
    found: dict[str, float] = {}
    for one, p in zip(ranked, each, strict=True):  # unknown forms of a place have one name
        name = _name(one.candidate.cause)
        found[name] = found.get(name, 0.0) + float(p)
    return dict(sorted(found.items(), key=lambda pair: -pair[1]))


def stated(
    one: Scored,
    is_later: bool,
    probability: Mapping[str, float],
    joint: Joint,
    causes: Sequence[Scored],
    random: np.random.Generator,
) -> Change:
    """Return a change as it is reported, next to all others that were found.

    `is_later` is whether it acts in the second campaign, `probability` that of each name that
    competes in its place, the likeliest first; `joint` is the regression without changes. The runs
    of its interval are random.
    """
    others = [c.candidate for c in causes if c is not one]
    source, acts = one.candidate.cause, one.candidate.acts
    assert acts is not None  # noqa: S101 - every candidate acts in the runs of one campaign
    name = _name(source)
    sure = probability[name] >= SURE
    how = "moved" if isinstance(source, Changed) else ("came" if is_later else "went")
    if isinstance(source, Function):
        return _of_unknown_form(one.candidate, how, probability)
    one = replace(one, candidate=_between_the_grid(one.candidate, source, joint, others))
    source = one.candidate.cause
    assert isinstance(source, Source)  # noqa: S101 - a wave stays one between the grid
    term = Term(source.effect, channels=dict(source.channels))
    chosen = [source.effect.amplitudes[k] for k in source.parts]
    labels = [p.name for p in chosen]
    for cause in (*others, one.candidate):
        joint = joint.with_cause(cause.laid, cause.precision)
    base = joint.fitted_on(np.ones(len(joint.runs)))
    values = [float(x) for x in base[-len(labels) :] / one.candidate.size[: len(labels)]]
    shared, spread = values[0] * float(np.mean(acts)), _spread(one, joint, random)
    if isinstance(source, Changed):
        acting = [run for run, own in zip(joint.runs, acts, strict=True) if own]
        values = [source.change(x, acting) for x in values]
        spread = np.array([[source.change(x, acting) for x in row] for row in spread])
    low, high = np.percentile(spread, [2.5, 97.5], axis=0)
    ends = zip(low, high, values, strict=True)
    return Change(
        verdict=how if sure else "one_of",
        how=how,
        name=name,
        equation=source.place.home,
        family=source.effect.id if isinstance(source, Changed) else source.family,
        alternatives=tuple(others_in_set(name, probability)),
        confidence=round(probability[name], 4),
        parameters=dict(zip(labels, values, strict=True)),
        ci95={
            label: (min(float(a), v), max(float(b), v))
            for label, (a, b, v) in zip(labels, ends, strict=True)
        },
        unit={
            p.name: term.unit(p, joint.layout.equations[source.place.home].target)
            for p in (*chosen, *source.effect.shape)
        },
        before=dict.fromkeys(labels, _before(source, joint, base, shared)),
        shape={p.name: float(x) for p, x in zip(source.effect.shape, source.shape, strict=True)},
        depends_on=variables_of(one.candidate),
        form=source.effect.id,
    )


def _of_unknown_form(candidate: Candidate, how: str, probability: Mapping[str, float]) -> Change:
    """Return a change without a name: what it depends on is known, and its place."""
    name = _name(candidate.cause)
    return Change(
        verdict="depends_on",
        how=how,
        name=name,
        equation=candidate.cause.place.home,
        family=candidate.cause.family,
        alternatives=tuple(others_in_set(name, probability)),
        confidence=round(probability[name], 4),
        depends_on=variables_of(candidate),
    )


def _between_the_grid(
    candidate: Candidate,
    source: Source,
    joint: Joint,
    others: Sequence[Candidate],
    steps: float = 4.0,
) -> Candidate:
    """Return a wave along a position with the order of the least error next to other causes.

    The search tries orders that are this many of the least steps apart. Another effect stays as it
    was found.
    """
    position = dict(source.channels)[source.turning] if source.is_wave else "_angle_rad"
    if position.endswith("_angle_rad"):
        return candidate
    for other in others:
        joint = joint.with_cause(other.laid, other.precision)
    k = [p.name for p in source.effect.shape].index("order")

    def of(order: float) -> Candidate:
        shape = (*source.shape[:k], order, *source.shape[k + 1 :])
        claim = Claim(replace(source, shape=shape), candidate.acts, given=True)
        return laid_out(joint, claim) or candidate

    def error(order: float) -> float:
        tried = of(order)
        grown = joint.with_cause(tried.laid, tried.precision)
        vector = np.append(grown.fitted_on(np.ones(len(joint.runs))), -1.0)
        parts = [joint.weights[p] * vector @ grown.gram[p].sum(axis=0) @ vector for p in grown.gram]
        return float(sum(parts))

    reach = steps * order_step(joint.layout, position)
    ends = source.shape[k] - reach, source.shape[k] + reach
    return of(float(minimize_scalar(error, bounds=ends, method="bounded").x))


def _before(source: Source, joint: Joint, base: FloatArray, shared: float) -> float | None:
    """Return a moved parameter in the first campaign, from all of them; None of an effect.

    `shared` is what an offset of all runs has of one of some, which are laid out apart.
    """
    if not isinstance(source, Changed):
        return None
    if source.effect.id == "sensor.gain":
        return 1.0
    own = joint.parameter(base, source.place.home, source.column)
    return own - (shared if source.effect.id == OFFSET else 0.0)


def _spread(
    one: Scored, grown: Joint, random: np.random.Generator, replicates: int = 200
) -> FloatArray:
    """Return a change's amplitudes, SI, in resampled sets of the runs of each campaign."""
    size = one.candidate.size
    sides = [np.flatnonzero(np.array(one.candidate.acts) == side) for side in (True, False)]
    spread = []
    for _ in range(replicates):
        counts = np.zeros(len(grown.runs))
        for side in sides:
            np.add.at(counts, random.choice(side, len(side)), 1.0)
        spread.append(grown.fitted_on(counts)[-len(size) :] / size)
    return np.array(spread)


def _name(cause: Source | Function) -> str:
    return cause.key if isinstance(cause, Changed) else f"{cause.family} at {cause.place.name}"
