"""Every kind of estimator on the same folds of runs, by the one interface they share.

Each is fitted on four fifths of the runs, written to a file, read again, and estimates the rest,
without lag and as live. All read the measured current and the encoders.
"""

import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from estimation import model_file
from estimation.bank.states import Bank
from estimation.campaign import Campaign
from estimation.cross_validation import closing_pairs
from estimation.estimator import Estimator, Recipe, load
from estimation.estimators.bank import BankRecipe
from estimation.estimators.model import ModelEstimator, ModelRecipe
from estimation.estimators.network import STATE_INPUTS, NetworkRecipe
from estimation.estimators.residual import ResidualRecipe
from estimation.networks.training import Settings, has_torch
from estimation.recording import FloatArray
from estimation.scores import Score, score
from rig.studies.oneill.paper import FILTERS, FOLDS, SURROGATES
from rig.studies.oneill.paper import PROXIMAL as TARGET

LOAD = SURROGATES["current"]
PAPER_INPUTS = ("spindle_angle_rad", "spindle_velocity_rad_s", LOAD)
EVERY = 24
"""Networks are trained on every so many-th closing sample."""


@dataclass(frozen=True)
class KindRow:
    """Error of one kind of estimator on runs held out, N m."""

    kind: str
    filters: str  # `zero-phase` or `live`
    score: Score  # errors over the closing samples of all runs, each held out once


def recipes() -> dict[str, Recipe]:
    """Return the recipe of each kind; networks only where torch is installed."""
    physical = ModelRecipe(replace(model_file.read(Path("motor")), run_offsets=False))
    line = ModelRecipe(model_file.read(Path("linear")))
    found: dict[str, Recipe] = {"straight line": line, "physical model": physical}
    if has_torch():
        few = Settings(nodes=12)
        states = (*STATE_INPUTS, LOAD)
        small = NetworkRecipe(PAPER_INPUTS, TARGET, few, every=EVERY)
        found |= {
            "paper's network": NetworkRecipe(PAPER_INPUTS, TARGET, every=EVERY),
            "physical model and a network on its residual": ResidualRecipe(physical, small),
            "network with physical states": NetworkRecipe(states, TARGET, few, every=EVERY),
        }
    bank = Bank(LOAD)
    found["products of physical states"] = BankRecipe(TARGET, bank)
    found["products of physical states, fitted live"] = BankRecipe(TARGET, bank, causal=True)
    return found


def run_kinds(
    campaign: Campaign, seed: int = 0, on_fit: Callable[[int, int], None] = lambda done, total: None
) -> tuple[KindRow, ...]:
    """Fit and score every kind.

    Raises:
        MissingChannelError: A run lacks a channel.
    """
    kept = campaign.evidence
    folds = kept.folds(min(FOLDS, len(kept)), seed)
    wanted = recipes()
    found: dict[tuple[str, str], list[tuple[FloatArray, FloatArray]]] = {}
    for count, fold in enumerate(folds):
        for place, (kind, recipe) in enumerate(wanted.items()):
            estimator = _kept(recipe.fit(fold.train))
            for filters in FILTERS:
                pairs = found.setdefault((kind, filters), [])
                pairs += closing_pairs(estimator, fold.test, filters == "live")
            on_fit(count * len(wanted) + place + 1, len(folds) * len(wanted))
    rows = []
    for (kind, filters), pairs in found.items():
        estimate, truth = (np.concatenate(parts) for parts in zip(*pairs, strict=True))
        rows.append(KindRow(kind, filters, score(estimate, truth)))
    return tuple(rows)


def _kept(estimator: Estimator) -> Estimator:
    """Write an estimator and read it again."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "estimator.npz"
        if isinstance(estimator, ModelEstimator):
            path = path.with_suffix(".toml")
        estimator.save(path)
        return load(path)
