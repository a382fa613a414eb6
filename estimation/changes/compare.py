"""What changed between two campaigns of one machine, with intervals over runs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from threadpoolctl import threadpool_limits

from estimation.causes.candidates import (
    Claim,
    Group,
    groups_of,
    laid_out,
    pool_of,
    skews,
    with_skews,
)
from estimation.causes.equations import Layout, lay_out
from estimation.causes.folds import Folds, folds_of
from estimation.causes.instruments import add_instruments
from estimation.causes.joint import Joint
from estimation.causes.levels import with_levels
from estimation.causes.numbers import Numbers
from estimation.causes.scoring import Scored, assessed, best_of_each, probabilities
from estimation.causes.search import Rank, Ranking, hypothesis
from estimation.causes.sources import Source
from estimation.changes.candidates import Moved, SensorGain, claims
from estimation.channels import unit_of
from estimation.errors import EstimationError
from estimation.fit_problem import OFFSET
from estimation.model import Model
from estimation.recording import FloatArray, Recording
from estimation.units import evaluate

SCHEMA = "rig.diff/2"

LEAST_RUNS = 4
"""Runs of each campaign: of fewer, a change and a difference between runs are alike."""

SURE, IN_SET = 0.9, 0.95
"""Probability from which a single name is given, and that a set of names covers."""

CHANGES = Numbers(
    sharpness=100.0, choice_price=0.002, cause_cost=0.02, between=1.0 / 40.0, form_floor=0.3**2
)
"""What decides. What the declared model lacks is in both campaigns, so scores are sharper than in a
diagnosis. The mean of a run weighs one of its `samples_a_run`, and the form of a change deviates by
`bend_share`. Chosen on drawn rigs, docs/decisions/0184."""

OUT_OF_REACH = 7.0
"""Log odds below the best change from which another one is not looked at."""

REPLICATES = 200
"""Resampled sets of runs, for intervals."""

A, B, ON = "A:", "B:", "C:"


class ChangesError(EstimationError):
    """Two campaigns cannot be compared."""


@dataclass(frozen=True)
class Change:
    """One change.

    Attributes:
        verdict: `moved` for a parameter, `came` or `went` for an effect, `one_of` where the runs do
            not distinguish some of them.
        name: What changed.
        equation: Equation it is reported under.
        family: The effect.
        alternatives: Other names that explain it about as well.
        confidence: Probability of this name next to the other changes, that of no change included.
        parameters: Parameter to its change from A to B (of an effect: its amplitude), SI.
        ci95: Parameter to the 95 % interval of that, over runs.
        unit: Parameter to its unit.
        before: Parameter to its value in A; None of an effect.
    """

    verdict: str
    name: str
    equation: str
    family: str
    alternatives: tuple[str, ...]
    confidence: float
    parameters: Mapping[str, float]
    ci95: Mapping[str, tuple[float, float]]
    unit: Mapping[str, str]
    before: Mapping[str, float | None]


@dataclass(frozen=True)
class Predicted:
    """Root mean square errors on a third campaign of an equation, within runs.

    Attributes:
        with_a: Fitted on A alone.
        with_b: Fitted on B alone.
        as_a: Fitted on both with the changes, taken as unchanged.
        as_b: The same, taken as changed.
        unit: Unit of the target.
    """

    with_a: float
    with_b: float
    as_a: float
    as_b: float
    unit: str


@dataclass(frozen=True)
class Difference:
    """The answer.

    Attributes:
        changes: The changes, largest first; empty where nothing changed beyond chance.
        runs: Campaign to the names of its runs.
        predicted: Equation to its errors on a third campaign; empty without one.
        notes: Limits of the answer, in words.
        seed: Seed of the random choices.
        schema: Name of this layout.
    """

    changes: tuple[Change, ...]
    runs: Mapping[str, tuple[str, ...]]
    predicted: Mapping[str, Predicted] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    seed: int = 0
    schema: str = SCHEMA


def compare(
    a: Sequence[Recording],
    b: Sequence[Recording],
    models: Sequence[Model],
    on: Sequence[Recording] = (),
    seed: int = 0,
    numbers: Numbers = CHANGES,
) -> Difference:
    """Find what changed from one campaign of a machine to another.

    A change is what the runs of one campaign need and those of the other do not. What both need
    alike, such as a friction of another form than the declared one, does not count.

    Args:
        a: Runs of the first campaign, four at least.
        b: Runs of the second one, four at least.
        models: Declared equations.
        on: Runs of a third campaign, to predict.
        seed: Seed of the random choices of runs.
        numbers: What decides.

    Raises:
        ChangesError: Too few runs.
        LayoutError: No equation can be written with the channels of both.
        FitError: A declared equation cannot be identified.
    """
    for name, runs in (("first", a), ("second", b)):
        if len(runs) < LEAST_RUNS:
            raise ChangesError(
                f"The {name} campaign has {len(runs)} run{'s' * (len(runs) != 1)}, too few to"
                " compare.",
                "A change is judged against the differences between runs of one campaign.",
                f"Record {LEAST_RUNS} runs at least of each, or cut a long recording into runs:"
                " lap_s under [data.runs] of the machine file.",
            )
    named = [*_named(a, A), *_named(b, B)]
    train = [r.name for r in named]
    layout = with_levels(lay_out(models, [*named, *_named(on, ON)], train), train, numbers)
    add_instruments(layout, train)
    fitted = layout.select(train)
    is_b = [run.name.startswith(B) for run in fitted.runs]
    plain = Joint(fitted, numbers)
    late = skews(plain)
    joint = with_skews(plain, late)
    pool = pool_of(joint, claims(fitted, is_b))
    with threadpool_limits(limits=1, user_api="blas"):  # threads wait for one another
        ranking = Ranking(joint, pool, _folds(fitted, is_b), _ranked(joint))
        first = ranking.next_to([])
        causes, ranked = list[Scored](), list[Sequence[Scored]]()
        if first and first[0].score > 0.0:
            causes, ranked = hypothesis(ranking, first[:1])
    prior = _prior(pool, joint.numbers)
    random = np.random.default_rng(seed)
    found = [
        _change(one, _shares(names, prior, joint.numbers), joint, causes, random)
        for one, names in zip(causes, ranked, strict=True)
    ]
    changes = {change.name: change for change in reversed(found)}
    return Difference(
        changes=tuple(reversed(changes.values())),
        runs={"a": tuple(r.name for r in a), "b": tuple(r.name for r in b)},
        predicted=_predicted(layout, late, causes) if on else {},
        notes=tuple(_notes({r.name: _stratum(r) for r in named})),
        seed=seed,
    )


def _named(recordings: Sequence[Recording], prefix: str) -> list[Recording]:
    return [replace(r, name=f"{prefix}{r.name}") for r in recordings]


def _stratum(recording: Recording) -> str:
    return repr(sorted((k, str(v)) for k, v in recording.conditions.items()))


def _notes(conditions: Mapping[str, str]) -> list[str]:
    of_a = {v for k, v in conditions.items() if k.startswith(A)}
    of_b = {v for k, v in conditions.items() if k.startswith(B)}
    if of_a == of_b:
        return []
    return [
        "The two campaigns were not recorded under the same conditions: what the declared model"
        " lacks under a condition that only one of them has can appear as a change."
    ]


def _folds(layout: Layout, is_b: Sequence[bool]) -> list[list[list[int]]]:
    """Return families of folds that omit runs of one campaign at a time.

    What the declared model lacks at a level is learnt from the other campaign's runs there.
    """
    return [
        [of_one for fold in family for side in (True, False) if (of_one := _of(fold, is_b, side))]
        for family in folds_of(layout)
    ]


def _of(fold: Sequence[int], is_b: Sequence[bool], side: bool) -> list[int]:
    return [run for run in fold if is_b[run] == side]


def _ranked(plain: Joint) -> Rank:
    """Return the ranking of changes that the campaigns do not share, next to others found.

    Args:
        plain: The regression without changes.
    """

    def ranked(joint: Joint, pool: Sequence[Group], folds: Folds) -> list[Scored]:
        found: list[Scored] = []
        least = _form_of_others(plain, joint, folds)
        for one in best_of_each(assessed(joint, pool, folds)):
            reach = OUT_OF_REACH / joint.numbers.sharpness
            if one.score < 0.0 or (found and one.score < found[0].score - reach):
                break
            if one.gain > least and _differs(one, joint, folds):
                found.append(one)
        return found

    return ranked


def _form_of_others(plain: Joint, joint: Joint, folds: Folds) -> float:
    """Return the gain that the inexact forms of the changes found may have missed.

    Their forms deviate from the catalogue's by a share: the square of it, of the error that they
    remove, does not count as another change.
    """
    spreads = [plain.extrapolated(family) for family in folds]
    removed = plain.score(spreads, plain.base_errors(folds), joint.base_errors(folds))[0]
    left = joint.numbers.bend_share**2 * float(np.expm1(max(0.0, float(removed))))
    return float(-np.log1p(-left)) if left < 1.0 else float("inf")


def _differs(one: Scored, joint: Joint, folds: Folds) -> bool:
    """Whether a change is worth its price where the same cause acts in both campaigns as well."""
    shared = laid_out(joint, Claim(one.candidate.cause))
    if shared is None:  # a declared column
        return True
    both = joint.with_cause(shared.laid, shared.precision)
    changed = replace(Claim(one.candidate.cause), acts=one.candidate.acts, given=True)
    again = assessed(both, groups_of(both, [changed]), folds)
    return bool(again) and again[0].gain > one.gain - one.score


def _source(one: Scored) -> Source:
    cause = one.candidate.cause
    assert isinstance(cause, Source)  # noqa: S101 - no candidate here has an unknown form
    return cause


def _key(one: Scored) -> str:
    """Return the name of a change in a report."""
    source = _source(one)
    return source.key if isinstance(source, Moved) else f"{source.family} at {source.place.name}"


def _prior(pool: Sequence[Group], numbers: Numbers) -> float:
    """Return the score by which a moved parameter is likelier than an effect that came or went.

    Either kind of change is as likely; the names of one kind share its probability.
    """
    names: dict[bool, set[tuple[str, str]]] = {True: set(), False: set()}
    for group in pool:
        for one in group.candidates:
            names[isinstance(one.cause, Moved)].add((one.cause.place.name, one.cause.family))
    return float(np.log(max(1, len(names[False])) / max(1, len(names[True]))) / numbers.sharpness)


def _shares(ranked: Sequence[Scored], prior: float, numbers: Numbers) -> dict[str, float]:
    """Return the probability of each name, the likeliest first."""
    more = [prior if isinstance(_source(one), Moved) else 0.0 for one in ranked]
    scores, gains = np.array([(s.score + m, s.gain) for s, m in zip(ranked, more, strict=True)]).T
    shares = probabilities(scores, gains, numbers.sharpness)
    found = {_key(one): float(p) for one, p in zip(ranked, shares, strict=True)}
    return dict(sorted(found.items(), key=lambda pair: -pair[1]))


def _change(
    one: Scored,
    shares: Mapping[str, float],
    joint: Joint,
    causes: Sequence[Scored],
    random: np.random.Generator,
) -> Change:
    name = _key(one)
    covered, others = shares[name], list[str]()
    for other, share in shares.items():
        if other != name and covered < (IN_SET if others else SURE) * sum(shares.values()):
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
        verdict=verdict if shares[name] >= SURE else "one_of",
        name=name,
        equation=source.place.home,
        family=source.effect.id if isinstance(source, Moved) else source.family,
        alternatives=tuple(others),
        confidence=round(shares[name], 4),
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


def _predicted(
    layout: Layout, late: Sequence[Claim], causes: Sequence[Scored]
) -> dict[str, Predicted]:
    """Return the errors on the third campaign's runs, by four models."""
    names = [run.name for run in layout.runs]
    of = {p: np.array([float(n.startswith(p)) for n in names]) for p in (A, B, ON)}
    plain = with_skews(Joint(layout), late)
    errors = [_rms(plain, plain.fitted_on(of[side]), of[ON]) for side in (A, B)]
    for taken_as in (A, B):
        grown = plain
        for one in causes:
            later = bool((one.candidate.acts or ())[-1])
            own = {A: not later, B: later, ON: (taken_as == B) == later}
            acts = tuple(own[name[:2]] for name in names)
            laid = laid_out(plain, replace(Claim(one.candidate.cause), acts=acts, given=True))
            if laid is not None:
                grown = grown.with_cause(laid.laid, laid.precision)
        errors.append(_rms(grown, grown.fitted_on(of[A] + of[B]), of[ON]))
    out = {}
    for name, equation in layout.equations.items():
        with_a, with_b, as_a, as_b = (found[name] for found in errors)
        out[name] = Predicted(with_a, with_b, as_a, as_b, equation.model.unit)
    return out


def _rms(joint: Joint, base: FloatArray, counts: FloatArray) -> dict[str, float]:
    """Return the root mean square error of each equation within some runs."""
    vector = np.append(base, -1.0)
    out = {}
    for name in joint.layout.equations:
        p = (name, "within")
        squared = np.einsum("i,rij,j->r", vector, joint.gram[p], vector)
        out[name] = float(np.sqrt(max(squared @ counts, 0.0) / (joint.samples[p] @ counts)))
    return out
