"""Which files at a path are in no run, and which runs do not count, with the reason of each."""

from collections.abc import Iterator
from pathlib import Path

from estimation.campaign import Campaign
from rig.importers.registry import importers

MAX_DEPTH = 3
"""Folders below the one given that are looked into."""

MAX_NAMES = 8
"""Files named in one line; more are counted."""


def left_out(path: Path, campaign: Campaign) -> list[str]:
    """Return the exclusions of an open campaign, one line per reason; empty if there are none.

    Files that no importer recognises as recordings (notes, pictures) are not listed.

    Args:
        path: What was opened.
        campaign: What it was opened as.
    """
    lines = [f"Run {r.name} does not count: {r.excluded}" for r in campaign.runs if r.excluded]
    if not path.is_dir():
        return lines
    taken = {run.source for run in campaign.runs}
    if None in taken:  # a table, whose machine file states which files are read
        return lines
    formats = {_format_of(source) for source in taken if source is not None}
    reasons: dict[str, list[str]] = {}
    for file in _files(path):
        if file in taken or (name := _format_of(file)) is None:
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


def _format_of(file: Path) -> str | None:
    """Return the name of the importer that recognises a file."""
    return next((name for name, one in importers().items() if one.recognises(file)), None)


def _files(folder: Path, depth: int = MAX_DEPTH) -> Iterator[Path]:
    for entry in sorted(folder.iterdir()):
        if entry.name.startswith("."):
            continue
        if entry.is_file():
            yield entry
        elif depth and entry.is_dir() and not entry.is_symlink():
            yield from _files(entry, depth - 1)


def _named(files: list[str]) -> str:
    shown = ", ".join(files[:MAX_NAMES])
    return f"{len(files)} files, {shown}, ..." if len(files) > MAX_NAMES else shown
