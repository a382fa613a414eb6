"""Whether a fitted model suits a rig: what it reads, and where its recordings are from."""

from collections.abc import Sequence
from pathlib import Path

from rig.configuration.config import Config
from rig.configuration.model_in_use import model_in_use
from rig.errors import UsageError
from rig.live.estimator import ModelEstimator


def require_channels(estimators: Sequence[ModelEstimator], config: Config, path: Path) -> None:
    """Refuse a model that reads channels which the configured rig does not have.

    Of a rig without a logger board the channels are known only once its device is connected.

    Raises:
        UsageError: A channel is missing; names the choice that made the model the one in use.
    """
    if config.logger.driver != "teensy":
        return
    there = config.calibration_set().channels
    absent = sorted({name for one in estimators for name in one.stream.channels} - set(there))
    if not absent:
        return
    fix = "Choose a model of this rig."
    if path == model_in_use(config.name):
        fix = (
            f"`rig model use` chose it for {config.name}; `rig model reset`, with the same --config"
            " or --sim, goes back to the configured model."
        )
    raise UsageError(
        f"The model {path.name} needs {', '.join(absent)}, which {config.name} does not measure.",
        f"It measures: {', '.join(there)}.",
        fix,
    )


def require_measured(estimators: Sequence[ModelEstimator], config: Config, path: Path) -> None:
    """Refuse a model that states it is of simulated recordings, for a real rig (UsageError)."""
    if config.is_simulated or not any(one.is_of_simulation for one in estimators):
        return
    raise UsageError(
        f"The model {path.name} was fitted on simulated recordings, and {config.name} is real.",
        "Its estimates would not be those of the rig.",
        "Fit one on recordings of the rig with `rig fit`, or add --from-simulation.",
    )
