"""What changed between two campaigns of one machine, with intervals over runs."""

from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np
from threadpoolctl import threadpool_limits

from estimation.arm.balances import declared_arm
from estimation.arm.shared import laid_out as with_shared_links
from estimation.causes.candidates import (
    Claim,
    laid_out,
    pool_of,
)
from estimation.causes.criterion import squared_of_runs
from estimation.causes.instruments import add_instruments
from estimation.causes.joint import Joint
from estimation.causes.layout import Layout, lay_out
from estimation.causes.levels import with_levels
from estimation.causes.nuisances import skews, with_skews
from estimation.causes.numbers import Numbers
from estimation.causes.scoring import Scored
from estimation.changes.candidates import claims
from estimation.changes.difference import Difference, Predicted
from estimation.changes.ranked import changes_in
from estimation.changes.remarks import of_recordings, unexplained
from estimation.changes.stated import prior_of_moved, shares, stated
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
        causes, ranked = changes_in(joint, pool, is_b, prior)
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
        notes=(*of_recordings(first, second), *unexplained(joint, causes, is_b)),
        seed=seed,
    )


def _is_later(one: Scored, is_b: Sequence[bool]) -> bool:
    """Whether a change acts in the runs of the second campaign, which may have earlier dates."""
    return any(b and acts for b, acts in zip(is_b, one.candidate.acts or (), strict=True))


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
            laid = laid_out(plain, Claim(one.candidate.cause, acts, given=True))
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
    out = {}
    for name in joint.layout.equations:
        p = (name, "within")
        squared = max(float(squared_of_runs(joint, base, p) @ counts), 0.0)
        out[name] = float(np.sqrt(squared / (joint.samples[p] @ counts)))
    return out
