"""Recordings of a machine that a file describes."""

import tomllib
from pathlib import Path

from estimation.campaign import Campaign
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
