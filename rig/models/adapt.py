"""An estimator of one instrument, adapted to another one with some of its runs."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from estimation.bank.interval import covered_share
from estimation.campaign import Campaign, in_folds
from estimation.estimator import Estimator
from estimation.estimators.adaptation import (
    Adaptable,
    Evidence,
    adapted,
    evidence,
    reduced,
    scratch,
    spread_out,
)
from estimation.estimators.bank import BankEstimator
from estimation.estimators.instrument import instrument_of, only_one
from estimation.scores import Score, score
from estimation.zeros import MovedZero, moved_zeros
from rig.errors import UsageError
from rig.output.provenance import Provenance

FOLDS = 5


@dataclass(frozen=True)
class Adaptation:
    """Errors on the closing samples of the runs not used, in the target's SI unit."""

    schema: str
    source: str  # file of the source's estimator
    kind: str  # `states` or `network`
    target: str
    used: tuple[str, ...]  # runs adapted with
    unused: tuple[str, ...]  # runs reported on
    left_out: tuple[str, ...]  # runs with flagged closing samples or without any, not reported on
    as_it_is: Score  # the source's estimator as it is
    adapted: Score  # the source's estimator adapted with the runs used
    # the same kind fitted on the target's other runs, in folds; None where not done
    scratch: Score | None
    # share of the samples inside the adapted estimator's interval; None without one
    covered: float | None
    rmse_by_run: dict[str, float]  # error of the adapted estimator by run
    moved_zeros: tuple[MovedZero, ...]  # runs at another zero than the others
    provenance: Provenance


def open_source(estimator: Estimator) -> Adaptable:
    """Return an estimator that can be adapted; UsageError of any other kind."""
    if isinstance(estimator, Adaptable):
        return estimator
    raise UsageError(
        "This model cannot be adapted.",
        "State estimators and networks can; a physical model is fitted again instead.",
        "Fit one: rig fit PATH --model states --out FILE.npz.",
    )


def runs_by_rule(source: Adaptable, campaign: Campaign, count: int) -> list[str]:
    """Return the names of `count` runs to adapt with, by their conditions alone.

    The rule is that of `estimation.estimators.adaptation.spread_out`; flagged runs are left out,
    and runs at another zero than most.

    Raises:
        UsageError: It is a network, whose runs must be named, or too few runs are there.
    """
    if not isinstance(source, BankEstimator):
        raise UsageError("Runs are chosen for state estimators only.", fix="Name them with --runs.")
    whole = {run.name: evidence(source, run) for run in campaign.evidence}
    moved = {name for zero in moved_zeros(campaign.evidence) for name in zero.runs}
    usable = {
        name: run
        for name, run in whole.items()
        if run is not None and run.flagged == 0 and name not in moved
    }
    if len(usable) <= count:
        raise UsageError(
            f"{len(usable)} usable runs are there, too few to choose {count} and report on others.",
            fix=f"Give --choose {len(usable) - 1} or less."
            if len(usable) > 1
            else "Record more runs of this instrument.",
        )
    names = list(usable)
    return [names[k] for k in spread_out(reduced(source, list(usable.values())), count)]


def run_adaptation(
    source: Adaptable,
    name: Path,
    campaign: Campaign,
    used: Sequence[str],
    *,
    from_scratch: bool,
    seed: int = 0,
    on_run: Callable[[str], None] = lambda run: None,
) -> tuple[Adaptation, Adaptable]:
    """Adapt the source's estimator with some runs, and report the errors on the others.

    For a run used the end of its name will do where it is one run's. `from_scratch` fits on the
    target's runs too. `on_run` is called with each run's name when it has been processed.

    Raises:
        UsageError: A run is not there, or none is left to report on.
    """
    chosen = [_named(run, campaign.names) for run in used]
    found: dict[str, Evidence] = {}
    left_out = []
    for recording in campaign.evidence:
        reduced = evidence(source, recording)
        if reduced is not None and (reduced.flagged == 0 or recording.name in chosen):
            found[recording.name] = reduced
        else:
            left_out.append(recording.name)
        on_run(recording.name)
    unused = [run for run in found if run not in chosen]
    if not unused or any(run not in found for run in chosen):
        raise UsageError(
            "No run remains to report on, or a chosen one has no closing samples.",
            f"Usable are: {', '.join(found) or 'none'}.",
        )
    new = adapted(source, [found[run] for run in chosen])
    instruments = {instrument_of(run) for run in campaign.select(chosen).evidence}
    new = replace(new, instrument=only_one(instruments))
    scores = [_score(estimator, [found[run] for run in unused]) for estimator in (source, new)]
    result = Adaptation(
        schema="rig.study.adapt/1",
        source=name.name,
        kind="states" if isinstance(source, BankEstimator) else "network",
        target=source.target,
        used=tuple(chosen),
        unused=tuple(unused),
        left_out=tuple(left_out),
        as_it_is=scores[0],
        adapted=scores[1],
        scratch=_scratch(source, found, unused, seed) if from_scratch else None,
        covered=_covered(new, [found[run] for run in unused]),
        rmse_by_run={run: _score(new, [found[run]]).rmse for run in unused},
        moved_zeros=tuple(moved_zeros(campaign.evidence)),
        provenance=Provenance.now(seed),
    )
    return result, new


def _named(wanted: str, names: Sequence[str]) -> str:
    fitting = [name for name in names if name == wanted or name.endswith(f"/{wanted}")]
    if len(fitting) != 1:
        raise UsageError(
            f"{wanted!r} names {len(fitting)} runs.",
            f"There are: {', '.join(names)}.",
            f"Give their whole names: --runs {','.join(names[:2])}.",
        )
    return fitting[0]


def _score(estimator: Adaptable, runs: Sequence[Evidence]) -> Score:
    return score(
        np.concatenate([run.estimate(estimator) for run in runs]),
        np.concatenate([run.truth for run in runs]),
    )


def _covered(estimator: Adaptable, runs: Sequence[Evidence]) -> float | None:
    if not isinstance(estimator, BankEstimator):
        return None
    found = [estimator.at(run.conditions).of_rows(run.rows) for run in runs]
    errors = [each.value - run.truth for each, run in zip(found, runs, strict=True)]
    return covered_share(np.concatenate(errors), np.concatenate([e.half_width for e in found]))


def _scratch(
    source: Adaptable,
    found: dict[str, Evidence],
    unused: Sequence[str],
    seed: int,
) -> Score | None:
    """Return the error of fits on the target alone, unused runs held out in folds."""
    names = list(found)
    if len(names) < FOLDS:
        return None
    estimates, truths = [], []
    for fold in in_folds(len(names), FOLDS, seed):
        held_out = [names[k] for k in fold]
        fitted = scratch(source, [found[run] for run in names if run not in held_out])
        for run in held_out:
            if run in unused:
                estimates.append(found[run].estimate(fitted))
                truths.append(found[run].truth)
    return score(np.concatenate(estimates), np.concatenate(truths))
