"""What changed between two campaigns of one machine, with intervals over runs."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from threadpoolctl import threadpool_limits

from estimation.causes.candidates import pool_of, skews, with_skews
from estimation.causes.equations import lay_out
from estimation.causes.instruments import add_instruments
from estimation.causes.joint import Joint
from estimation.causes.levels import with_levels
from estimation.causes.numbers import Numbers
from estimation.causes.scoring import Scored
from estimation.causes.search import Ranking, hypothesis
from estimation.changes.candidates import claims
from estimation.changes.difference import Difference
from estimation.changes.predicted import ON, A, B, errors
from estimation.changes.ranking import folds_of_one_campaign, in_one_alone
from estimation.changes.stated import prior_of_moved, shares, stated
from estimation.errors import EstimationError
from estimation.model import Model
from estimation.recording import Recording

LEAST_RUNS = 4
"""Runs of each campaign: of fewer, a change and a difference between runs are alike."""

CHANGES = Numbers(
    sharpness=100.0, choice_price=0.002, cause_cost=0.02, between=1.0 / 40.0, form_floor=0.3**2
)
"""What decides. What the declared model lacks is in both campaigns, so scores are sharper than in a
diagnosis. The mean of a run weighs one of its `samples_a_run`, and the form of a change deviates by
`bend_share`. Chosen on drawn rigs, docs/decisions/0184."""


class ChangesError(EstimationError):
    """Two campaigns cannot be compared."""


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
        ranking = Ranking(joint, pool, folds_of_one_campaign(fitted, is_b), in_one_alone(joint))
        first = ranking.next_to([])
        causes, ranked = list[Scored](), list[Sequence[Scored]]()
        if first and first[0].score > 0.0:
            causes, ranked = hypothesis(ranking, first[:1])
    prior = prior_of_moved(pool, joint.numbers)
    random = np.random.default_rng(seed)
    found = [
        stated(one, shares(names, prior, joint.numbers), joint, causes, random)
        for one, names in zip(causes, ranked, strict=True)
    ]
    changes = {change.name: change for change in reversed(found)}
    return Difference(
        changes=tuple(reversed(changes.values())),
        runs={"a": tuple(r.name for r in a), "b": tuple(r.name for r in b)},
        predicted=errors(layout, late, causes) if on else {},
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
