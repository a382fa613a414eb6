"""The closing samples behind the network rows: the neutral pose, and the poses of experiment 3."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from estimation.campaign import Campaign
from rig.importers.registry import open_campaign
from rig.studies.oneill.closing_table import ClosingTable, closing_table
from rig.studies.oneill.network_jobs import CHANNELS, POSES
from rig.studies.oneill.paper import PAPER_POSE_SAMPLES

POSE_FREQUENCY_HZ = 0.3
"""The paper's experiment 3 holds one frequency; the pitch folders hold a second one."""


def network_tables(
    neutral: Campaign,
    folder: Path | None,
    on_run: Callable[[str], None] = lambda name: None,
) -> tuple[dict[str, ClosingTable], tuple[str, ...]]:
    """Return the closing samples by pose, and remarks about them.

    Args:
        neutral: The runs of experiments 1 and 2.
        folder: Folder that may hold the folders or archives of experiment 3, or be next to them.
        on_run: Called with each run's name when it has been processed.

    Raises:
        DataError: A run is damaged, or nothing is left.
        MissingChannelError: A run lacks a channel.
    """
    tables = {"neutral": closing_table(neutral, CHANNELS, on_run=on_run)}
    notes = []
    for pose in ("pitch", "roll"):
        runs = pose_runs(folder, pose)
        if runs is None:
            notes.append(f"No data of experiment 3, {pose}: its rows are left out.")
        else:
            tables[pose] = closing_table(runs, CHANNELS, POSES[pose], on_run)
    if len(tables) == 3:
        count = sum(len(tables[pose].run) for pose in ("pitch", "roll"))
        same = "the paper's count" if count == PAPER_POSE_SAMPLES else "the paper has 962,936"
        notes.append(f"Experiment 3 has {count:,} closing samples: {same}.")
    return tables, tuple(notes)


def pose_runs(folder: Path | None, pose: str) -> Campaign | None:
    """Return the runs of the five folders of a pose at the paper's frequency, if all are there."""
    if folder is None or not folder.is_dir():
        return None
    found: dict[str, Path] = {}
    for place in (folder, folder.parent):
        for path in sorted(place.glob(f"*{pose.title()}_[1-5]*")):
            found.setdefault(path.name.split(".")[0].removeprefix("mrdlab-"), path)
    if len(found) != 5:
        return None
    recordings = []
    for name, path in sorted(found.items()):
        for recording in open_campaign(path):
            if np.isclose(float(recording.conditions["frequency_hz"]), POSE_FREQUENCY_HZ):
                recordings.append((f"{name}/{recording.name}", recording))
    return Campaign.of(replace(recording, name=name) for name, recording in recordings)
