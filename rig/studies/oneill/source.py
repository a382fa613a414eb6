"""Data for the study of O'Neill et al. 2018: the measured folder, or other recordings."""

from dataclasses import dataclass
from pathlib import Path

from estimation.campaign import Campaign
from rig.importers.registry import open_campaign

INSTRUMENT = "Tool_4_Maryland_L_4"
"""Folder of the measured data that the paper's first two experiments were made of."""


@dataclass(frozen=True)
class Source:
    """Data for the study.

    Attributes:
        campaign: The runs.
        name: What the data is, for the reader.
        measured: Whether it was measured on the paper's instrument.
        notes: Remarks for the reader.
    """

    campaign: Campaign
    name: str
    measured: bool
    notes: tuple[str, ...] = ()


def open_reference(path: Path) -> Source:
    """Open the paper's part of the measured data.

    Args:
        path: The folder or archive of Tool_4_Maryland_L_4, or a folder or archive that holds it
            among others; any other recordings are taken as they are.

    Raises:
        UsageError: There is nothing at the path.
        DataError: Nothing there can be read.
    """
    place = part_of(path, INSTRUMENT)
    notes = [f"{path.name} holds several parts; {place.name} was taken."] if place != path else []
    campaign = open_campaign(place)
    own = [name for name in campaign.names if f"{INSTRUMENT}/" in name]
    if own and len(own) < len(campaign):
        notes.append(f"{len(own)} of {len(campaign)} runs are of {INSTRUMENT} and were taken.")
        campaign = campaign.select(own)
    measured = bool(own) or INSTRUMENT in place.name
    if not measured:
        notes.append(f"Not the paper's instrument ({INSTRUMENT}): its numbers do not apply.")
    return Source(campaign, place.name, measured, tuple(notes))


def part_of(path: Path, instrument: str) -> Path:
    """Return the folder or archive of an instrument below a path, or the path itself."""
    if path.is_file() or path.name == instrument:
        return path
    parts = sorted(
        (p for p in path.rglob(f"*{instrument}*") if p.name.split(".")[0].endswith(instrument)),
        key=lambda p: (p.is_file(), len(p.parts), p),
    )
    return parts[0] if parts else path
