"""The error of a state estimator on runs that it was not fitted on."""

import numpy as np

from estimation.campaign import Campaign, in_folds
from estimation.estimators.bank import BankRecipe, fit_runs
from estimation.scores import Score, score


def held_out_score(recipe: BankRecipe, campaign: Campaign, folds: int, seed: int) -> Score:
    """Return the error on runs not fitted, each held out once; flagged samples are left out.

    Args:
        recipe: What is fitted.
        campaign: The runs; excluded ones are left out.
        folds: Number of folds, at least 2.
        seed: Seed of the folds.

    Raises:
        NetworkError: No sample is a closing one.
    """
    found = [recipe.evidence_of(recording) for recording in campaign.evidence]
    runs = [run for run in found if run is not None]
    estimates, truths = [], []
    for held_out in in_folds(len(runs), folds, seed):
        rest = [run for k, run in enumerate(runs) if k not in held_out]
        fitted = fit_runs(rest, recipe.bank, recipe.target, recipe.settings)
        estimates += [fitted.of_design(runs[k].design, runs[k].rows).value for k in held_out]
        truths += [runs[k].truth for k in held_out]
    return score(np.concatenate(estimates), np.concatenate(truths))
