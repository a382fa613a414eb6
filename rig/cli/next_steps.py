"""`rig` alone: the state of rig, calibrations and recordings here, and what to type next."""

from collections.abc import Iterator
from pathlib import Path

import typer

from calibration.errors import CalibrationError
from calibration.store import CalibrationStore, default_folder
from rig.campaigns.index import IndexedCampaign, campaigns, default_index
from rig.campaigns.search import families, verdict
from rig.configuration.chosen import default_config
from rig.configuration.config import load_config
from rig.errors import KNOWN_ERRORS

RECORDINGS = Path("logs")

Step = tuple[str, str]
"""What is here, or missing, and what to type next; empty if nothing is needed."""


def show_next_steps() -> None:
    """Print the state of what is here, what to type next, and where all commands are listed."""
    sim = " --sim" if default_config() is None else ""
    record = f"rig record{sim} --protocol diagnosis"
    for state, command in (*of_the_rig(), *of_recordings(RECORDINGS, record)):
        typer.echo(f"{state}\n  {command}" if command else state)
    typer.echo("\nAll commands: rig -h. By task: docs/how-to.md.")


def of_the_rig() -> Iterator[Step]:
    """Yield the state of the configured rig and of its calibrations."""
    config = default_config()
    if config is None:
        yield "No rig is configured. Without hardware:", "rig demo"
        yield "With a board plugged in:", "rig config init"
        return

    try:
        settings = load_config(config)
    except KNOWN_ERRORS:
        yield f"The configuration {config} cannot be used.", f"rig config check {config}"
        return
    if settings.is_simulated:
        yield f"Rig: {settings.name} ({config}), simulated.", ""
        return
    yield f"Rig: {settings.name} ({config}).", "rig doctor"
    yield from _of_calibrations()


def _of_calibrations() -> Iterator[Step]:
    try:
        active = CalibrationStore(default_folder()).active()
    except (CalibrationError, OSError):
        yield "The calibration store cannot be read.", "rig calibrate check"
        return
    if active:
        yield f"Calibrations in use: {len(active)}.", "rig calibrate check"
    else:
        yield "No calibration of this rig is stored.", "rig calibrate torque"


def of_recordings(root: Path, record: str) -> Iterator[Step]:
    """Yield the state of the newest campaign below a folder, else the command that records one."""
    try:
        found = campaigns(root, default_index(root)) if root.is_dir() else []
    except OSError as error:
        yield f"The recordings in {root} cannot be listed: {error}.", ""
        return
    if not found:
        yield f"There is no recording in {root}.", record
        return
    yield f"{len(found)} recorded campaigns in {root}.", "rig campaigns"
    recorded = [one for one in found if not one.is_calibration]
    yield _of_campaign(recorded[0]) if recorded else ("They are all calibrations.", record)


def _of_campaign(newest: IndexedCampaign) -> Step:
    folder = newest.folder
    broken = [run for run in newest.runs if run.state != "complete" or run.lost]
    if broken:
        state = f"The newest, {folder}: {len(broken)} of {len(newest.runs)} runs not complete."
        return state, f"rig log check {folder}"
    if newest.diagnosis is None:
        return f"The newest, {folder}, is not diagnosed.", f"rig diagnose {folder}"
    said = ", ".join([verdict(newest).replace("_", " "), *families(newest)])
    return f"The newest, {folder}: {said}.", f"rig campaigns --open --root {folder}"
