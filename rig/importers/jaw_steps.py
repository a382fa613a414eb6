"""Find steps of the jaw's zero between the runs of a campaign: a cable that slipped, a re-index.

A single run cannot show such a step, so this is a remark on the campaign, made by walking it.
"""

from dataclasses import dataclass

import numpy as np

from estimation.campaign import Campaign
from estimation.recording import Recording

STEP_LIMIT_RAD = float(np.deg2rad(0.3))
"""On the reference rig, equal runs repeat within 0.22 deg and steps are 0.35 to 0.63 deg."""
ALIKE = (
    "load_command_a",
    "jaw_stop_index",
    "trajectory_centre_rad",
    "trajectory_amplitude_rad",
    "wrist_roll_rad",
    "wrist_pitch_rad",
)
"""Runs that agree in these conditions should have the same mean angle of the jaw."""


@dataclass(frozen=True, slots=True)
class JawStep:
    """A step of the jaw's mean angle between two runs that should agree.

    Attributes:
        run: The later run.
        compared_with: The nearest earlier run under the same conditions.
        step_rad: Change of the mean jaw angle, rad, closing positive.
    """

    run: str
    compared_with: str
    step_rad: float


def jaw_steps(campaign: Campaign, limit_rad: float = STEP_LIMIT_RAD) -> tuple[JawStep, ...]:
    """Compare each run's mean jaw angle with the last earlier run under the same conditions.

    The load stretches the cable and so moves the jaw by degrees; only runs of the same load, wrist,
    trajectory and instrument are compared. Flagged samples are left out. One run is held at a time.

    Args:
        campaign: Runs with `jaw_angle_rad`, in the order they were taken.
        limit_rad: Smaller changes are not reported, rad.

    Raises:
        MissingChannelError: A run has no `jaw_angle_rad`.
    """
    last: dict[tuple[object, ...], tuple[str, float]] = {}
    found = []
    for recording in campaign.evidence:
        if not recording.valid.any():
            continue
        mean_rad = float(recording["jaw_angle_rad"][recording.valid].mean())
        key = _alike(recording)
        if key in last:
            name, before_rad = last[key]
            if abs(mean_rad - before_rad) > limit_rad:
                found.append(JawStep(recording.name, name, mean_rad - before_rad))
        last[key] = recording.name, mean_rad
    return tuple(found)


def _alike(recording: Recording) -> tuple[object, ...]:
    return (recording.instrument, *(recording.conditions.get(name) for name in ALIKE))
