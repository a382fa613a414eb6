"""The error of a model or an estimator on runs it was not fitted on."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from estimation.bank.interval import of_new_run
from estimation.campaign import Campaign, in_folds
from estimation.closing import is_closing, processed
from estimation.estimator import Estimator, Recipe
from estimation.estimators.bank import BankRecipe, fit_runs
from estimation.fitting import fit
from estimation.model import Model, counted_error
from estimation.recording import FloatArray
from estimation.scores import Score, rmse, score


@dataclass(frozen=True, slots=True)
class HeldOutError:
    """Error of a model on runs it was not fitted on, in the target's unit.

    Attributes:
        rmse: Root mean square over all samples, each run's mean error removed.
        rmse_with_means: The same with the means left in.
        rmse_by_run: Run to its own error, mean removed.
        folds: Number of folds; every run is in just one of them.
        half_width: Half the 95 % interval of the estimate live; see `live_half_width`.
    """

    rmse: float
    rmse_with_means: float
    rmse_by_run: dict[str, float]
    runs: int
    folds: int
    half_width: float | None


def held_out_error(declared: Model, campaign: Campaign, folds: int, seed: int = 0) -> HeldOutError:
    """Fit a model on all folds but one and score it on that one, for every fold.

    Values that the model has are starting points only.

    Raises:
        CampaignError: Fewer runs than folds, or fewer than two.
        FitError: The model's parameters are not identifiable from a fold's runs.
    """
    errors: dict[str, FloatArray] = {}
    live: list[FloatArray] = []
    for split in campaign.folds(folds, seed):
        fitted = fit(declared, split.train, bootstrap=0)
        errors |= {run.name: counted_error(fitted, run) for run in split.test}
        live += [counted_error(fitted, run, causal=True) for run in split.test]
    centred = {name: error - error.mean() for name, error in errors.items() if error.size}
    return HeldOutError(
        rmse=rmse(np.concatenate(list(centred.values())), 0.0),
        rmse_with_means=rmse(np.concatenate(list(errors.values())), 0.0),
        rmse_by_run={name: rmse(error, 0.0) for name, error in sorted(centred.items())},
        runs=len(errors),
        folds=folds,
        half_width=live_half_width(live),
    )


def live_half_width(errors: Sequence[FloatArray]) -> float | None:
    """Return half the 95 % interval of a live estimate in a new run; None without two runs.

    The errors are those of each run with causal filters, of a model that was not fitted on it.
    """
    known = [error[np.isfinite(error)] for error in errors]
    squares = [float(np.mean(error**2)) for error in known if error.size]
    return of_new_run(squares) if len(squares) > 1 else None


def closing_score(
    recipe: Recipe,
    campaign: Campaign,
    folds: int,
    seed: int = 0,
    on_fold: Callable[[], None] = lambda: None,
) -> Score:
    """Return the error of a recipe's estimators on closing samples, each run held out once.

    `on_fold` is called when a fold is done.

    Raises:
        CampaignError: Fewer runs than folds, or fewer than two.
    """
    pairs = []
    for split in campaign.folds(folds, seed):
        pairs += closing_pairs(recipe.fit(split.train), split.test)
        on_fold()
    return score(np.concatenate([e for e, _ in pairs]), np.concatenate([t for _, t in pairs]))


def closing_pairs(
    estimator: Estimator, runs: Campaign, causal: bool = False
) -> list[tuple[FloatArray, FloatArray]]:
    """Return estimate and sensor at the closing samples of each run, the sensor without lag."""
    pairs = []
    for recording in runs.evidence:
        run = processed(recording, [estimator.target])
        closing = is_closing(run)
        pairs.append(
            (estimator.predict(recording, causal)[closing], run[estimator.target][closing])
        )
    return pairs


def held_out_score(recipe: BankRecipe, campaign: Campaign, folds: int, seed: int) -> Score:
    """Return the error of a state estimator on runs not fitted; flagged samples are left out.

    Raises:
        NetworkError: No sample is a closing one.
    """
    found = [recipe.evidence_of(recording) for recording in campaign.evidence]
    runs = [run for run in found if run is not None]
    estimates, truths = [], []
    for held_out in in_folds(len(runs), folds, seed):
        rest = [run for k, run in enumerate(runs) if k not in held_out]
        fitted = fit_runs(rest, recipe.bank, recipe.target)
        estimates += [fitted.of_design(runs[k].design, runs[k].rows).value for k in held_out]
        truths += [runs[k].truth for k in held_out]
    return score(np.concatenate(estimates), np.concatenate(truths))
