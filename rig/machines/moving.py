"""Runs in which a machine rests: they identify nothing of its motion."""

from collections.abc import Sequence

from estimation.campaign import Campaign
from estimation.causes.equations import LEAST, samples_in_motion
from estimation.derived import measured_channels
from estimation.model import Model
from estimation.recording import Recording


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
        there = all(name in recording for name in needed)
        if there and samples_in_motion(model, recording) < LEAST:
            return recording.exclude(f"too few samples in motion for {model.balance}")
    return recording
