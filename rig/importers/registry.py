"""Open recordings of any known format: a file, a folder or an archive becomes a campaign.

An importer is an object in the entry point group `rig.importers`. Whatever the format, a run that
is read is checked for channels that contradict their derivatives, and the runs are of one rig and
one instrument: the first run that is read sets them, the first that differs is refused.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Protocol, runtime_checkable

from estimation.campaign import Campaign, Run
from estimation.copies import without_copies
from estimation.errors import EstimationError
from estimation.recording import Recording
from rig.errors import DataError, UsageError
from rig.importers.derivatives import checked

MAX_DEPTH = 3
"""Folders below the one given that are looked into."""

MAX_NAMES = 8
"""Files named in one line; more are counted."""


class MixedRunsError(DataError):
    """Runs of different rigs or instruments were opened as one campaign."""


@runtime_checkable
class Importer(Protocol):
    """Interface of a format's importer.

    Attributes:
        name: Short name of the format, as typed on the command line.
        description: One line on the format.
    """

    name: str
    description: str

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


def open_campaign(path: Path, format_name: str | None = None, skip_bad: bool = False) -> Campaign:
    """Open a file, folder or archive of any known format; a run that is there twice counts once.

    The importer is guessed from the path where none is named. With `skip_bad` every run is read
    once, and those that cannot be read are excluded, with the reason.

    Raises:
        UsageError: The path does not exist, or the format is not known.
        DataError: No importer recognises the path, or the one that does finds damage. Reading a
            run raises it where a channel and its derivative contradict one another, and
            MixedRunsError where it is of another rig or instrument.
    """
    campaign = without_copies(_importer(path, format_name).open(path))
    first: dict[str, tuple[str, str]] = {}
    runs = [replace(run, load=partial(_read, run, first)) for run in campaign.runs]
    return Campaign(tuple(map(or_excluded, runs) if skip_bad else runs))


def unreadable(name: str, error: DataError, source: Path | None = None) -> Run:
    """Return a run that cannot be read: whoever reads it gets the error."""

    def load() -> Recording:
        raise error

    return Run(name, load, source)


def or_excluded(run: Run) -> Run:
    """Return a run, excluded where reading it shows that it is damaged."""
    try:
        run.load()
    except MixedRunsError:
        raise  # which of the rigs is meant is for the user to say
    except (DataError, EstimationError) as error:
        return replace(run, excluded=run.excluded or f"{error.what} {error.why}".strip())
    return run


def _read(run: Run, first: dict[str, tuple[str, str]]) -> Recording:
    """Read and check a run; `first` holds each property of the first run, and that run's name."""
    recording = run.load()
    if run.excluded is not None or recording.excluded is not None:
        return checked(recording)
    own = recording.instrument
    instrument = " ".join(part for part in (own.model, own.serial) if part) or "an unnamed one"
    for what, value in (("rigs", recording.rig or "an unnamed one"), ("instruments", instrument)):
        known, name = first.setdefault(what, (value, run.name))
        if known != value:
            raise MixedRunsError(
                f"The runs are of several {what}: {name} of {known}, {run.name} of {value}.",
                f"What differs between {what} would be taken for an effect.",
                "Give the folder of one of them.",
            )
    return checked(recording)


def _importer(path: Path, format_name: str | None) -> Importer:
    if not path.exists():
        raise UsageError(f"There is no file or folder {path}.", fix="Check the path.")
    known = importers()
    if format_name is not None:
        if format_name not in known:
            raise UsageError(
                f"There is no importer {format_name!r}.", f"Installed: {', '.join(known)}."
            )
        return known[format_name]
    if (name := format_of(path)) is not None:
        return known[name]
    raise DataError(
        f"{path} holds no recording that rig reads by itself.",
        f"{_content(path)} Tried: {', '.join(known)}.".lstrip(),
        "A table of another layout: state its columns under [data] of the machine file, and name"
        " that by --machine FILE; or rig import. One of these formats: name it with --format.",
    )


def _content(path: Path) -> str:
    if not path.is_dir():
        return ""
    endings = Counter(file.suffix or "no ending" for file in path.iterdir() if file.is_file())
    if not endings:
        return "The folder holds no file."
    return f"Its files: {', '.join(f'{n} {ending}' for ending, n in endings.most_common(4))}."


def left_out(path: Path, campaign: Campaign) -> list[str]:
    """Return the exclusions of the campaign that a path was opened as, one line per reason.

    Files that no importer recognises as recordings (notes, pictures) are not listed.
    """
    lines = [f"Run {r.name} does not count: {r.excluded}" for r in campaign.runs if r.excluded]
    if not path.is_dir():
        return lines
    taken = {run.source for run in campaign.runs}
    if None in taken:  # a table, whose machine file states which files are read
        return lines
    formats = {format_of(source) for source in taken if source is not None}
    reasons: dict[str, list[str]] = {}
    for file in files_below(path):
        if file in taken or (name := format_of(file)) is None:
            continue
        reason = (
            "an earlier attempt of a run, or repaired"
            if name in formats
            else f"another format; --format {name} opens it"
        )
        reasons.setdefault(reason, []).append(str(file.relative_to(path)))
    return lines + [
        f"Left out, {reason}: {_named(files)}." for reason, files in sorted(reasons.items())
    ]


def format_of(file: Path) -> str | None:
    """Return the name of the importer that recognises a path, None where none does."""
    return next((name for name, one in importers().items() if one.recognises(file)), None)


def files_below(folder: Path, depth: int = MAX_DEPTH) -> Iterator[Path]:
    """Walk the files of a folder, then those of the folders in it, each sorted by name."""
    entries = sorted(entry for entry in folder.iterdir() if not entry.name.startswith("."))
    yield from (entry for entry in entries if entry.is_file())
    if depth:
        for entry in entries:
            if entry.is_dir() and not entry.is_symlink():
                yield from files_below(entry, depth - 1)


def files_ending(path: Path, *endings: str) -> list[Path]:
    """Return the files at a path with an ending: the file itself, or those of a folder by name."""
    entries = sorted(path.iterdir()) if path.is_dir() else [path]
    return [e for e in entries if e.is_file() and e.name.lower().endswith(endings)]


def _named(files: list[str]) -> str:
    shown = ", ".join(files[:MAX_NAMES])
    return f"{len(files)} files, {shown}, ..." if len(files) > MAX_NAMES else shown
