"""What changed between two campaigns of one machine, with intervals over runs."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np
from threadpoolctl import threadpool_limits

from estimation.arm.balances import declared_arm
from estimation.arm.shared import laid_out as with_shared_links
from estimation.causes.candidates import (
    Claim,
    Group,
    groups_of,
    laid_out,
    pool_of,
)
from estimation.causes.criterion import base_errors, extrapolated, score
from estimation.causes.folds import Folds, folds_of
from estimation.causes.instruments import add_instruments
from estimation.causes.joint import Joint
from estimation.causes.layout import Layout, lay_out
from estimation.causes.levels import with_levels
from estimation.causes.nuisances import skews, with_skews
from estimation.causes.numbers import Numbers
from estimation.causes.ranking import Rank, Ranking
from estimation.causes.scoring import Scored, assessed, best_of_each
from estimation.causes.search import hypothesis
from estimation.changes.candidates import Changed, claims
from estimation.changes.difference import Difference, Predicted
from estimation.changes.stated import likeliest_first, prior_of_moved, score_of, shares, stated
from estimation.copies import copies
from estimation.diagnosis.split import SplitError, periods
from estimation.errors import EstimationError
from estimation.model import Model
from estimation.recording import UNDATED_NS, FloatArray, Recording

A, B, ON = "A:", "B:", "C:"
"""What the names of the runs of each campaign begin with."""

CHANGES = Numbers(
    sharpness=100.0, choice_price=0.002, cause_cost=0.02, between=1.0 / 40.0, form_floor=0.3**2
)
"""What decides. What the declared model lacks is in both campaigns, so scores are sharper than in a
diagnosis. The mean of a run weighs one of its `samples_a_run`, and the form of a change deviates by
`bend_share`. Chosen on drawn rigs, docs/decisions/0184."""


class ChangesError(EstimationError):
    """Two campaigns cannot be compared."""


def compare(
    a: Iterable[Recording],
    b: Iterable[Recording],
    models: Sequence[Model],
    on: Iterable[Recording] = (),
    seed: int = 0,
    numbers: Numbers = CHANGES,
) -> Difference:
    """Find what changed from one campaign of a machine to another.

    A change is what the runs of one campaign need and those of the other do not. What both need
    alike, such as a friction of another form than the declared one, does not count. Nor have the
    links of an arm changed, which all its joints share.

    Args:
        a: Runs of the first campaign, four at least, or one path of so many periods.
        b: The same of the second one.
        models: Declared equations.
        on: Runs of a third campaign, to predict.
        seed: Seed of the random choices of runs.
        numbers: What decides.

    Raises:
        ChangesError: Too few runs.
        LayoutError: No equation can be written with the channels of both.
        FitError: A declared equation cannot be identified.
    """
    first, second, third = (_named(*x) for x in ((a, A), (b, B), (on, ON)))
    for campaign, runs in (("first", first), ("second", second)):
        _check_number(campaign, runs)
    both = [*first, *second]
    train, everything = [r.name for r in both], [*both, *third]
    arm = declared_arm(models, both)
    if arm is not None:
        everything = with_shared_links(arm, everything, train)
    layout = with_levels(lay_out(models, everything, train), train, numbers)
    add_instruments(layout, train)
    fitted = layout.select(train)
    is_b = [run.name.startswith(B) for run in fitted.runs]
    plain = Joint(fitted, numbers)
    late = skews(plain)
    joint = with_skews(plain, late)
    pool = pool_of(joint, claims(fitted, is_b))
    prior = prior_of_moved(pool, numbers)
    with threadpool_limits(limits=1, user_api="blas"):  # threads wait for one another
        rank = _in_one_alone(joint, prior)
        ranking = Ranking(joint, pool, _folds_of_one_campaign(fitted, is_b), rank)
        best = ranking.next_to([])
        causes, ranked = list[Scored](), list[Sequence[Scored]]()
        if best and best[0].score > 0.0:
            causes, ranked = hypothesis(ranking, best[:1])
            causes = [_since_the_first(one, is_b, joint) for one in causes]
    random = np.random.default_rng(seed)
    found = [
        stated(one, _is_later(one, is_b), shares(names, prior, numbers), joint, causes, random)
        for one, names in zip(causes, ranked, strict=True)
    ]
    changes = {change.name: change for change in reversed(found)}
    return Difference(
        changes=tuple(reversed(changes.values())),
        runs={
            name: tuple(r.name.removeprefix(mark) for r in runs)
            for name, mark, runs in (("a", A, first), ("b", B, second))
        },
        predicted=_predicted(layout, late, [(x, _is_later(x, is_b)) for x in causes])
        if third
        else {},
        notes=(
            *_shared(first, second),
            *_other_conditions(first, second),
            *_unexplained(joint, causes, is_b),
        ),
        seed=seed,
    )


def _is_later(one: Scored, is_b: Sequence[bool]) -> bool:
    """Whether a change acts in the runs of the second campaign, which may have earlier dates."""
    return any(b and acts for b, acts in zip(is_b, one.candidate.acts or (), strict=True))


def _since_the_first(one: Scored, is_b: Sequence[bool], joint: Joint) -> Scored:
    """Return a moved parameter as a change in the second campaign; an effect stays as it is."""
    if not isinstance(one.candidate.cause, Changed):
        return one
    turned = laid_out(joint, replace(Claim(one.candidate.cause), acts=tuple(is_b), given=True))
    return one if turned is None else replace(one, candidate=turned)


def _named(recordings: Iterable[Recording], mark: str) -> list[Recording]:
    """Return the runs of a campaign with its mark; one path that repeats itself, in periods."""
    runs = list(recordings)
    if len(runs) == 1:
        with suppress(SplitError):  # one run, and no path of several periods
            runs = periods(runs[0])
    dated = all((r.started_at_ns or 0) >= UNDATED_NS for r in runs)
    starts = [r.started_at_ns if dated else None for r in runs]  # clocks have a zero each
    named = zip(runs, starts, strict=True)
    return [replace(r, name=f"{mark}{r.name}", started_at_ns=start) for r, start in named]


def _check_number(campaign: str, runs: Sequence[Recording], least: int = 4) -> None:
    """Refuse fewer runs: of these, a change and a difference between runs are alike."""
    if len(runs) < least:
        raise ChangesError(
            f"The {campaign} campaign has {len(runs)} run{'s' * (len(runs) != 1)}, too few to"
            " compare.",
            "A change is judged against the differences between runs of one campaign.",
            f"Record {least} runs at least of each, or cut a long recording into runs:"
            " lap_s under [data.runs] of the machine file.",
        )


def _shared(first: Sequence[Recording], second: Sequence[Recording]) -> tuple[str, ...]:
    """Return that runs are in both campaigns, where they are."""
    found = copies([*first, *second])
    if not found:
        return ()
    pairs = ", ".join(f"{original} and {copy}" for copy, original in found.items())
    return (
        f"Check: these runs are the same, sample by sample: {pairs}. Is one campaign named twice,"
        " or was a file copied? A run that is in both shows no change.",
    )


def _other_conditions(first: Sequence[Recording], second: Sequence[Recording]) -> tuple[str, ...]:
    conditions = [
        {repr(sorted((k, str(v)) for k, v in r.conditions.items())) for r in runs}
        for runs in (first, second)
    ]
    if conditions[0] == conditions[1]:
        return ()
    return (
        "The two campaigns were not recorded under the same conditions: what the declared model"
        " lacks under a condition that only one of them has can appear as a change.",
    )


def _unexplained(
    joint: Joint, causes: Sequence[Scored], is_b: Sequence[bool], least: float = 1.2
) -> Iterator[str]:
    """Yield which equations still fit every run of one campaign worse than all of the other.

    The medians of the errors differ by a factor of `least` or more.
    """
    for one in causes:
        joint = joint.with_cause(one.candidate.laid, one.candidate.precision)
    vector, later = np.append(joint.fitted_on(np.ones(len(is_b))), -1.0), np.array(is_b)
    for name, equation in joint.layout.equations.items():
        p = name, "within"
        squared = np.einsum("i,rij,j->r", vector, joint.gram[p], vector) / joint.samples[p]
        error = np.sqrt(np.maximum(squared, 0.0))
        sides = {"first": error[~later], "second": error[later]}
        better, worse = sorted(sides, key=lambda side: float(np.median(sides[side])))
        low, high = (float(np.median(sides[side])) for side in (better, worse))
        if sides[worse].min() > sides[better].max() and high >= least * low:
            yield (
                f"Check: the equation {name} fits the {worse} campaign worse than the {better} one,"
                f" {high:.3g} against {low:.3g} {equation.model.unit}. More has changed than is"
                " stated here, its form is another one, or a sensor has more noise."
            )


def _folds_of_one_campaign(layout: Layout, is_b: Sequence[bool]) -> list[list[list[int]]]:
    """Return families of folds that omit runs of one campaign at a time, never all of it.

    What the declared model lacks at a level is learnt from the other campaign's runs there. A level
    that is all of a campaign shows nothing: its change cannot be fitted without it.
    """
    whole = {side: list(is_b).count(side) for side in (True, False)}
    found = []
    for family in folds_of(layout):
        sided = [
            (side, [run for run in fold if is_b[run] == side]) for fold in family for side in whole
        ]
        if all(len(runs) < whole[side] for side, runs in sided):
            found.append([runs for _, runs in sided if runs])
    return found


def _in_one_alone(plain: Joint, prior: float, reach: float = 7.0) -> Rank:
    """Return the ranking of changes that the campaigns do not share, next to others found.

    The likeliest is first, a moved parameter by `prior` more likely than its score. Another change
    is not tried from log odds of `reach` below the best one.
    """

    def ranked(joint: Joint, pool: Sequence[Group], folds: Folds) -> list[Scored]:
        found: list[Scored] = []
        least = _form_of_others(plain, joint, folds)
        best = best_of_each(assessed(joint, pool, folds))
        named = [
            Claim(x.candidate.cause, x.candidate.acts, x.candidate.choices, given=True)
            for x in best
            if not x.candidate.is_function
        ]
        for one in best:
            far = bool(found) and one.score < found[0].score - reach / joint.numbers.sharpness
            if one.score < 0.0 or far:
                break
            if one.gain > least and _differs(one, named, joint, folds, prior):
                found.append(one)
        return likeliest_first(found, prior)

    return ranked


def _form_of_others(plain: Joint, joint: Joint, folds: Folds) -> float:
    """Return the gain that the inexact forms of the changes found may have missed.

    Their forms deviate from the catalogue's by a share: the square of it, of the error that they
    remove, does not count as another change.
    """
    spreads = [extrapolated(plain, family) for family in folds]
    removed = score(plain, spreads, base_errors(plain, folds), base_errors(joint, folds))
    left = joint.numbers.bend_share**2 * float(np.expm1(max(0.0, float(removed))))
    return float(-np.log1p(-left)) if left < 1.0 else float("inf")


def _differs(one: Scored, named: Sequence[Claim], joint: Joint, folds: Folds, prior: float) -> bool:
    """Whether a change is worth its price where the same cause acts in both campaigns as well.

    An unknown form is fitted to what the declared model lacks in both. Next to it in both it has to
    be likelier than each of the named changes there.
    """
    shared = laid_out(joint, Claim(one.candidate.cause))
    if one.candidate.cause.is_declared or shared is None:  # in both already
        return True
    both = joint.with_cause(shared.laid, shared.precision)
    changed = replace(Claim(one.candidate.cause), acts=one.candidate.acts, given=True)
    again = assessed(both, groups_of(both, [changed]), folds)
    worth = max((x.gain for x in again), default=0.0) - one.price.score(joint.numbers)
    if worth <= 0.0 or not changed.is_function:
        return worth > 0.0
    rivals = assessed(both, groups_of(both, named), folds)
    return worth >= max((score_of(x, prior) for x in rivals), default=0.0)


def _predicted(
    layout: Layout, late: Sequence[Claim], causes: Sequence[tuple[Scored, bool]]
) -> dict[str, Predicted]:
    """Return the errors on the third campaign's runs, by four models.

    Each change has whether it acts in the second campaign.
    """
    names = [run.name for run in layout.runs]
    of = {mark: np.array([float(n.startswith(mark)) for n in names]) for mark in (A, B, ON)}
    plain = with_skews(Joint(layout), late)
    errors = [_rms(plain, plain.fitted_on(of[side]), of[ON]) for side in (A, B)]
    for taken_as in (A, B):
        grown = plain
        for one, later in causes:
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
