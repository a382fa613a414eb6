"""One instrument's estimators on other instruments: unchanged, adapted, and fitted again.

The runs adapted with are the ones of the tables before: one run, or three. As much depends on which
these are, states are adapted with each single run, and with threes drawn at random, too.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from estimation.bank.interval import covered_share
from estimation.campaign import Campaign
from estimation.estimators.adaptation import Evidence, adapted_states, evidence, reduced
from estimation.estimators.bank import BankEstimator
from estimation.zeros import moved_zeros
from rig.models.adapt import Adaptation, open_source, run_adaptation
from rig.output.provenance import Provenance
from rig.studies.oneill.kinds import recipes

KINDS = ("products of physical states", "network with physical states", "paper's network")
"""Which kinds of estimators are adapted; networks where torch is installed."""

USED = (("11",), ("22",), ("00", "11", "22"), ("03", "21", "42"))
"""Runs adapted with."""

THREE, DRAWS = 3, 40
"""Runs of a draw, and draws."""


@dataclass(frozen=True)
class InstrumentRow:
    """One kind of estimator, one instrument and the runs adapted with."""

    kind: str
    instrument: str
    result: Adaptation


@dataclass(frozen=True)
class DrawnRow:
    """States adapted with many choices of so many runs, N m."""

    instrument: str
    # whether runs at another zero than most are left out, of those adapted with and of those
    # reported on
    usual: bool
    runs: int
    rmse_n_m: tuple[float, ...]  # error on the runs not used, by choice, rising
    # mean over the choices of the share of samples inside their interval; None without
    covered: float | None


@dataclass(frozen=True)
class InstrumentStudy:
    """Results."""

    schema: str
    source: str
    rows: tuple[InstrumentRow, ...]
    drawn: tuple[DrawnRow, ...]  # what the choice of the runs makes of them
    provenance: Provenance


def run_instruments(
    source: tuple[str, Campaign],
    others: Mapping[str, Campaign],
    used: Sequence[Sequence[str]] = USED,
    networks: bool = True,
    seed: int = 0,
    on_row: Callable[[int, int], None] = lambda done, total: None,
) -> InstrumentStudy:
    """Fit each kind on the source and adapt it to each other instrument, by each choice of runs.

    Raises:
        UsageError: A run is not there.
        MissingChannelError: A run lacks a channel.
    """
    name, campaign = source
    known = recipes()
    wanted = {kind: known[kind] for kind in (KINDS if networks else KINDS[:1]) if kind in known}
    total = len(wanted) * len(others) * len(used)
    rows: list[InstrumentRow] = []
    choices: list[DrawnRow] = []
    for kind, recipe in wanted.items():
        estimator = open_source(recipe.fit(campaign))
        for instrument, runs in others.items():
            for place, chosen in enumerate(used):
                result, _ = run_adaptation(
                    estimator,
                    Path(name),
                    runs,
                    chosen,
                    from_scratch=place == 0,  # it barely depends on which runs are not used
                    seed=seed,
                )
                rows.append(InstrumentRow(kind, instrument, result))
                on_row(len(rows), total)
            if isinstance(estimator, BankEstimator):
                choices += drawn(estimator, instrument, runs, seed)
    return InstrumentStudy(
        "rig.study.instruments/3", name, tuple(rows), tuple(choices), Provenance.now(seed)
    )


def drawn(
    source: BankEstimator, instrument: str, campaign: Campaign, seed: int
) -> tuple[DrawnRow, ...]:
    """Adapt with each single run, and with threes drawn at random; flagged runs are left out.

    Where runs are at another zero than most, a gear or cable slipped, once more without them.
    """
    whole = {recording.name: evidence(source, recording) for recording in campaign.evidence}
    sound = {name: run for name, run in whole.items() if run is not None and run.flagged == 0}
    moved = {name for zero in moved_zeros(campaign.evidence) for name in zero.runs}
    rows = _drawn(source, instrument, list(sound.values()), seed, usual=False)
    if moved:
        usual = [run for name, run in sound.items() if name not in moved]
        rows += _drawn(source, instrument, usual, seed, usual=True)
    return tuple(rows)


def _drawn(
    source: BankEstimator, instrument: str, sound: Sequence[Evidence], seed: int, *, usual: bool
) -> list[DrawnRow]:
    runs = reduced(source, sound)
    if len(runs) <= THREE:
        return []
    draw = np.random.default_rng(seed)
    threes = [tuple(draw.choice(len(runs), THREE, replace=False)) for _ in range(DRAWS)]
    rows = []
    for choices in ([(k,) for k in range(len(runs))], threes):
        errors, shares = [], []
        for choice in choices:
            new = adapted_states(source, [runs[k] for k in choice])
            rest = [run for k, run in enumerate(runs) if k not in choice]
            design = np.concatenate([run.design for run in rest])
            error = design @ new.weights - np.concatenate([run.truth for run in rest])
            errors.append(float(np.sqrt(np.mean(error**2))))
            if new.interval is not None:
                places = np.concatenate([run.places for run in rest])
                shares.append(covered_share(error, new.interval.half_width(design, places)) or 0.0)
        covered = float(np.mean(shares)) if shares else None
        rows.append(DrawnRow(instrument, usual, len(choices[0]), tuple(sorted(errors)), covered))
    return rows
