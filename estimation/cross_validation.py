"""The error of a declared model on runs it was not fitted on."""

from dataclasses import dataclass

import numpy as np

from estimation.campaign import Campaign
from estimation.derived import settled_places
from estimation.fitting import fit
from estimation.model import Model, balance_channels, estimate
from estimation.recording import FloatArray


@dataclass(frozen=True, slots=True)
class HeldOutError:
    """Error of a model on runs it was not fitted on, in the target's unit.

    Attributes:
        rmse: Root mean square over all samples, each run's mean error removed.
        rmse_with_means: The same with the means left in.
        rmse_by_run: Run to its own error, mean removed.
        runs: Number of runs.
        folds: Number of folds; every run is in just one of them.
    """

    rmse: float
    rmse_with_means: float
    rmse_by_run: dict[str, float]
    runs: int
    folds: int


def held_out_error(declared: Model, campaign: Campaign, folds: int, seed: int = 0) -> HeldOutError:
    """Fit a model on all folds but one and score it on that one, for every fold.

    Args:
        declared: The model; values it may have are starting points only.
        campaign: The runs.
        folds: Number of folds.
        seed: Seed of the folds.

    Raises:
        CampaignError: Fewer runs than folds, or fewer than two.
        FitError: A fold's runs do not tell the model's parameters.
    """
    errors: dict[str, FloatArray] = {}
    for split in campaign.folds(folds, seed):
        fitted = fit(declared, split.train, bootstrap=0)
        for recording in split.test:
            run = balance_channels(fitted, recording)
            places = settled_places(run, fitted.low_pass, samples=fitted.samples)
            error = run[fitted.target] - estimate(fitted, run)
            errors[recording.name] = error[places]
    whole = np.concatenate(list(errors.values()))
    centred = {name: error - error.mean() for name, error in errors.items() if error.size}
    return HeldOutError(
        rmse=_rms(np.concatenate(list(centred.values()))),
        rmse_with_means=_rms(whole),
        rmse_by_run={name: _rms(error) for name, error in sorted(centred.items())},
        runs=len(errors),
        folds=folds,
    )


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))
