"""One instrument's estimators on other instruments: as they are, adapted, and fitted anew.

The runs adapted with are the ones of the tables before: one run, or three.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from estimation.bank.states import Bank
from estimation.campaign import Campaign
from estimation.estimator import Recipe
from estimation.estimators.bank import BankRecipe
from estimation.estimators.network import STATE_INPUTS, NetworkRecipe
from estimation.networks.training import Settings, has_torch
from rig.reports.provenance import Provenance
from rig.studies.adapt import Adaptation, open_source, run_adaptation
from rig.studies.oneill_kinds import EVERY, LOAD, PAPER_INPUTS, TARGET

USED = (("11",), ("22",), ("00", "11", "22"), ("03", "21", "42"))
"""Runs adapted with."""


@dataclass(frozen=True)
class InstrumentRow:
    """One kind of estimator, one instrument and the runs adapted with."""

    kind: str
    instrument: str
    result: Adaptation


@dataclass(frozen=True)
class InstrumentStudy:
    """Results.

    Attributes:
        schema: Name of this layout.
        source: Instrument the estimators were fitted on.
        rows: The rows.
        provenance: When and from what this was made.
    """

    schema: str
    source: str
    rows: tuple[InstrumentRow, ...]
    provenance: Provenance


def recipes(networks: bool) -> dict[str, Recipe]:
    """Return what fits each kind; networks only where they are wanted and torch is installed."""
    found: dict[str, Recipe] = {"products of physical states": BankRecipe(TARGET, Bank(LOAD))}
    if networks and has_torch():
        inputs = (*STATE_INPUTS, LOAD)
        found |= {
            "network with physical states": NetworkRecipe(
                inputs, TARGET, Settings(nodes=12), every=EVERY
            ),
            "paper's network": NetworkRecipe(PAPER_INPUTS, TARGET, every=EVERY),
        }
    return found


def run_instruments(
    source: tuple[str, Campaign],
    others: Mapping[str, Campaign],
    used: Sequence[Sequence[str]] = USED,
    networks: bool = True,
    seed: int = 0,
    on_row: Callable[[int, int], None] = lambda done, total: None,
) -> InstrumentStudy:
    """Fit each kind on the source and adapt it to each other instrument.

    Args:
        source: Name and runs of the instrument that estimators are fitted on.
        others: Name and runs of the others.
        used: Names of the runs adapted with, one row each.
        networks: Whether to train networks too.
        seed: Seed of the folds of fits anew.
        on_row: Called with the number of rows done and their total.

    Raises:
        UsageError: A run is not there.
        MissingChannelError: A run lacks a channel.
    """
    name, campaign = source
    wanted = recipes(networks)
    total = len(wanted) * len(others) * len(used)
    rows: list[InstrumentRow] = []
    for kind, recipe in wanted.items():
        estimator = open_source(recipe.fit(campaign))
        for instrument, runs in others.items():
            for place, chosen in enumerate(used):
                result, _ = run_adaptation(
                    estimator,
                    Path(name),
                    runs,
                    chosen,
                    from_scratch=place == 0,  # it hardly depends on which runs are not used
                    seed=seed,
                )
                rows.append(InstrumentRow(kind, instrument, result))
                on_row(len(rows), total)
    return InstrumentStudy("rig.study.instruments/1", name, tuple(rows), Provenance.now(seed))
