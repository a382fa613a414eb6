"""Recordings of a machine that a file describes, and which of them have it in motion."""

import tomllib
from collections.abc import Sequence
from pathlib import Path

from estimation.campaign import Campaign
from estimation.derived import measured_channels
from estimation.model import Model
from estimation.recording import Recording
from rig.importers.log import LogImporter
from rig.importers.registry import open_campaign
from rig.importers.table.mapping import read_mapping
from rig.importers.table.open import open_table
from rig.machines.shipped import place_of


def open_recordings(
    path: Path,
    machine: Path | None = None,
    format_name: str | None = None,
    skip_bad: bool = False,
) -> Campaign:
    """Open recordings, those of a foreign table by the machine file's `[data]`.

    Args:
        path: File, folder or archive.
        machine: Machine file or the name of a shipped one; None for the reference rig.
        format_name: Importer to use; found from the path when None.
        skip_bad: Exclude runs that cannot be read, with the reason. Not of a foreign table.

    Raises:
        UsageError: The path does not exist, or the format is not known.
        DataError: The recordings cannot be read.
        NoPlantError: No such machine.
    """
    if machine is None or format_name is not None or LogImporter().recognises(path):
        return open_campaign(path, format_name, skip_bad)
    file = place_of(machine)
    if not has_data(file):
        return open_campaign(path, None, skip_bad)
    return open_table(path, read_mapping(file, ()))


def has_data(file: Path) -> bool:
    """Whether a machine file states how a foreign table is read."""
    return "data" in tomllib.loads(file.read_text("utf-8"))


def with_motion(campaign: Campaign, models: Sequence[Model]) -> Campaign:
    """Return a campaign with the runs excluded that have too few samples in motion.

    Args:
        campaign: The runs.
        models: Declared equations; one whose channels were not recorded decides nothing.
    """
    return Campaign.of([_checked(run.recording(), models) for run in campaign.runs])


def _checked(recording: Recording, models: Sequence[Model]) -> Recording:
    from estimation.causes.equations import LEAST, samples_in_motion  # a view needs none of it

    if recording.excluded is not None:
        return recording
    for model in models:
        needed = measured_channels([*model.channels, model.target], model.signals)
        there = all(name in recording for name in needed)
        if there and samples_in_motion(model, recording) < LEAST:
            return recording.exclude(f"too few samples in motion for {model.balance}")
    return recording
