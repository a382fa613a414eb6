"""Open recordings of any known format: a file, a folder or an archive becomes a campaign.

An importer is an object in the entry point group `rig.importers`. It recognises the format of a
path without reading the samples, and opens it as a campaign of run handles. Whatever the
format, a run that is read is checked for channels that contradict their derivatives.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Protocol, runtime_checkable

from estimation.campaign import Campaign
from estimation.recording import Recording
from rig.errors import DataError, UsageError
from rig.importers.derivatives import checked
from rig.importers.one_rig import of_one_rig


@runtime_checkable
class Importer(Protocol):
    """Interface of a format's importer."""

    name: str
    """Short name of the format, as typed on the command line."""

    description: str
    """One line on the format."""

    def recognises(self, path: Path) -> bool:
        """Whether the path looks like this format, from names and first lines only."""

    def open(self, path: Path) -> Campaign:
        """Open a file, folder or archive as a campaign whose runs load when asked.

        Raises:
            DataError: The path is not of this format or damaged; names file, line and what was
                expected.
        """


def importers() -> dict[str, Importer]:
    """Return every installed importer by name; a third party adds one by entry point.

    Raises:
        UsageError: An entry point does not load, or is not an importer; none is skipped silently.
    """
    return {entry.name: _loaded(entry) for entry in sorted(entry_points(group="rig.importers"))}


def _loaded(entry: EntryPoint) -> Importer:
    package = entry.dist.name if entry.dist else entry.module
    try:
        importer = entry.load()
    except (ImportError, AttributeError) as error:
        raise UsageError(
            f"The importer {entry.name!r} of {package} cannot be loaded: {error}.",
            f"Its entry point is {entry.value}.",
            f"Install {package} again, or remove it.",
        ) from error
    if not isinstance(importer, Importer):
        raise UsageError(
            f"{entry.value} of {package} is not an importer.",
            "Expected an object with name, description, recognises() and open().",
            f"Install {package} again, or remove it.",
        )
    return importer


def open_campaign(path: Path, format_name: str | None = None) -> Campaign:
    """Open recordings of any known format.

    The runs are of one rig and one instrument: reading one that is not raises MixedRunsError.

    Args:
        path: File, folder or archive.
        format_name: Importer to use; guessed from the path when None.

    Raises:
        UsageError: The path does not exist, or the format is not known.
        DataError: No importer recognises the path, or the one that does finds damage. Reading a
            run raises it where a channel and its derivative differ by a factor, a sign or a shift.
    """
    campaign = _opened(path, format_name)
    return replace(
        campaign, runs=tuple(replace(run, load=partial(_read, run.load)) for run in campaign.runs)
    )


def _read(load: Callable[[], Recording]) -> Recording:
    return checked(load())


def _opened(path: Path, format_name: str | None) -> Campaign:
    if not path.exists():
        raise UsageError(f"There is no file or folder {path}.", fix="Check the path.")
    known = importers()
    if format_name is not None:
        if format_name not in known:
            raise UsageError(
                f"There is no importer {format_name!r}.", f"Installed: {', '.join(known)}."
            )
        return of_one_rig(known[format_name].open(path))
    for importer in known.values():
        if importer.recognises(path):
            return of_one_rig(importer.open(path))
    raise DataError(
        f"No importer recognises {path}.",
        f"Tried: {', '.join(known)}.",
        "Name the format with --format if the file is one of these.",
    )
