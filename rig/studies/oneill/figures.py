"""Figures of the study: estimate against sensor over time, error before and after."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from markupsafe import Markup

from estimation.recording import FloatArray
from rig.output.figures import Panel, against, over_time, write_svgs
from rig.studies.oneill.networks_page import SHOWN
from rig.studies.oneill.shown import Closing, Shown

ANGLE, SPEED, LOAD = 0, 2, 1
"""Channels of a row: the spindle's angle, the motor's speed, the surrogate."""


def draw(shown: Sequence[Shown]) -> dict[str, tuple[str, Markup]]:
    """Return caption and figure by name."""
    drawn = {}
    for one in shown:
        name, unit, scale = SHOWN[one.target]
        stem = f"oneill-{name.replace(' ', '-')}"
        run = one.runs[one.median_run]
        caption = (
            f"{name.capitalize()}, closing samples of run {run.name}, the run of median error: the"
            " sensor, a straight line through the command, and physical states, live, both"
            " fitted on other runs."
        )
        series = {
            "sensor": run.truth,
            "line": one.before[one.median_run],
            "states": one.after[one.median_run],
        }
        time_s, lines = _gapped(run, {k: scale * v for k, v in series.items()})
        label = f"{name}, {unit}"
        drawn[f"{stem}-time"] = caption, over_time(time_s, lines, label, caption)
        caption = (
            f"Error of the {name} on held-out runs: mean and the middle 90 % of the closing"
            " samples; before: a straight line through the command; after: physical states, live."
        )
        drawn[f"{stem}-error"] = (
            caption,
            against(_panels(one, scale), f"error, {unit}", caption),
        )
    return drawn


def write(folder: Path, shown: Sequence[Shown]) -> list[tuple[str, Path]]:
    """Write the figures; return caption and file of each."""
    drawn = draw(shown)
    paths = write_svgs(folder, {name: figure for name, (_, figure) in drawn.items()})
    return [(caption, path) for (caption, _), path in zip(drawn.values(), paths, strict=True)]


def _gapped(
    run: Closing, series: dict[str, FloatArray]
) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Put the samples on the run's own clock, with gaps where it does not close."""
    period_s = float(np.median(np.diff(run.time_s)))
    ticks = np.rint((run.time_s - run.time_s[0]) / period_s).astype(np.int64)
    lines = {name: np.full(ticks[-1] + 1, np.nan) for name in series}
    for name, values in series.items():
        lines[name][ticks] = values
    return run.time_s[0] + period_s * np.arange(ticks[-1] + 1), lines


def _panels(one: Shown, scale: float) -> list[Panel]:
    truth = np.concatenate([run.truth for run in one.runs])
    rows = np.concatenate([run.rows[:, [ANGLE, LOAD, SPEED]] for run in one.runs])
    before, after = (scale * (np.concatenate(e) - truth) for e in (one.before, one.after))
    variables = {
        "spindle angle, rad": rows[:, 0],
        "motor speed, rad/s": rows[:, 2],
        "command (load)": rows[:, 1],
    }
    return [Panel(label, x, after, before) for label, x in variables.items()]
