"""Figures of the study: estimate against sensor over time, error before and after."""

from collections.abc import Mapping, Sequence

import numpy as np
from markupsafe import Markup

from estimation.recording import FloatArray
from rig.output.figures import against, over_time
from rig.studies.oneill.paper import SHOWN
from rig.studies.oneill.states import Shown

VARIABLES = {"spindle angle, rad": 0, "motor speed, rad/s": 2, "command (load)": 1}
"""Channels of a row, by what the error is drawn over."""


def draw(shown: Mapping[str, Sequence[Shown]]) -> dict[str, tuple[str, Markup]]:
    """Return caption and figure by name, of the runs of each target."""
    drawn = {}
    for target, runs in shown.items():
        name, unit, scale = SHOWN[target]
        stem = f"oneill-{name.replace(' ', '-')}"
        errors = [np.mean((run.after - run.truth) ** 2) for run in runs]
        run = runs[int(np.argsort(errors)[len(errors) // 2])]
        caption = (
            f"{name.capitalize()}, closing samples of run {run.name}, the run of median error: the"
            " sensor, a straight line through the command, and physical states, live, both"
            " fitted on other runs."
        )
        series = {"sensor": run.truth, "line": run.before, "states": run.after}
        time_s, lines = _gapped(run.time_s, {k: scale * v for k, v in series.items()})
        figure = over_time(time_s, lines, f"{name}, {unit}", caption)
        drawn[f"{stem}-time"] = caption, figure
        caption = (
            f"Error of the {name} on held-out runs: mean and the middle 90 % of the closing"
            " samples; before: a straight line through the command; after: physical states, live."
        )
        before, after = (
            scale * np.concatenate([getattr(run, which) - run.truth for run in runs])
            for which in ("before", "after")
        )
        rows = np.concatenate([run.rows for run in runs])
        variables = {label: rows[:, k] for label, k in VARIABLES.items()}
        figure = against(variables, before, after, f"error, {unit}", caption)
        drawn[f"{stem}-error"] = caption, figure
    return drawn


def _gapped(
    time_s: FloatArray, series: dict[str, FloatArray]
) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Put the samples on the run's own clock, with gaps where it does not close."""
    period_s = float(np.median(np.diff(time_s)))
    ticks = np.rint((time_s - time_s[0]) / period_s).astype(np.int64)
    lines = {name: np.full(ticks[-1] + 1, np.nan) for name in series}
    for name, values in series.items():
        lines[name][ticks] = values
    return time_s[0] + period_s * np.arange(ticks[-1] + 1), lines
