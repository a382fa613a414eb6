"""Runs in which a machine rests: they identify nothing of its motion."""

from collections.abc import Sequence

from estimation.campaign import Campaign
from estimation.causes.equations import GRID_PER_CUTOFF
from estimation.derived import measured_channels
from estimation.model import Model, balance_channels, settled
from estimation.recording import Recording

LEAST = 20
"""Samples in motion that an equation needs of a run, as thinly as they are regressed on."""


def with_motion(campaign: Campaign, models: Sequence[Model]) -> Campaign:
    """Return a campaign with the runs excluded that have too few samples in motion.

    Args:
        campaign: The runs.
        models: Declared equations; one whose channels were not recorded decides nothing.
    """
    return Campaign.of([_checked(run.recording(), models) for run in campaign.runs])


def _checked(recording: Recording, models: Sequence[Model]) -> Recording:
    if recording.excluded is not None:
        return recording
    for model in models:
        needed = measured_channels([*model.channels, model.target], model.signals)
        if not all(name in recording for name in needed):
            continue
        step = round(recording.sample_rate_hz / (GRID_PER_CUTOFF * model.low_pass.cutoff_hz))
        channels = balance_channels(model, recording)
        if len(settled(model, channels, max(1, step))) < LEAST:
            return recording.exclude(f"too few samples in motion for {model.balance}")
    return recording
