"""The simulated rig with the declared equations of a diagnosis, to play experiments on."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from estimation import model_file
from estimation.campaign import Campaign
from estimation.errors import EstimationError
from estimation.fitting import fit
from estimation.model import Model
from estimation.recording import Recording
from rig.errors import RigError
from rig.simulation.fitted_rig import FittedRig, fitted_rig

PLAYED = ("motor", "gearbox", "cable", "stretch")
"""Equations of the simulated rig's own parts; also the names of their shipped models."""


def simulated_rig(fitted: Sequence[Model], train: Sequence[Recording]) -> FittedRig | None:
    """Return the simulated rig with the fitted equations.

    An equation that is not diagnosed is taken from the shipped models and fitted on the same runs:
    the plant needs all its parts.

    Args:
        fitted: The declared equations, fitted on the training runs.
        train: The training runs.

    Returns:
        None where the simulated rig has none of the equations, or the runs lack a channel.
    """
    own = {model.balance: model for model in fitted if model.balance in PLAYED}
    if not own:
        return None
    campaign, parts = Campaign.of(train), []
    signals = next(iter(own.values())).signals
    try:
        for name in PLAYED:
            model = own.get(name)
            try:
                shipped = replace(model_file.read(Path(name)), signals=signals)
                parts.append(model or fit(shipped, campaign, bootstrap=0))
            except EstimationError:
                continue
        return fitted_rig(parts, list(campaign.evidence))
    except (RigError, EstimationError):
        return None
