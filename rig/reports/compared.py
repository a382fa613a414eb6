"""A comparison of two estimators as sentences and tables."""

from collections.abc import Sequence

import numpy as np

from estimation.channels import unit_of
from rig.live.text import in_shown_unit
from rig.models.compared import Comparison, RunErrors, Side
from rig.output.table import TextTable

WHERE = ("frequency_hz", "load_command_a", "wrist_roll_rad", "wrist_pitch_rad", "jaw_stop_index")
"""Conditions that the errors are shown by, where runs differ in them."""


def lines(found: Comparison) -> list[str]:
    """Return the result in a sentence."""
    a, b = found.sides
    wins = sum(run.rmse[0] < run.rmse[1] for run in found.runs)
    said = [f"{a.file} has the smaller error in {wins} of {len(found.runs)} runs."]
    if found.better is None:
        said.append(f"These runs do not show which is better (p {found.p:.2f}).")
    else:
        ratio = min(found.rmse) / max(found.rmse)
        name = found.sides[found.better].file
        said.append(f"{name} is better: {ratio:.2f} times the error (p {found.p:.2g}).")
    said += [_origin(side) for side in (a, b)]
    if found.left_out:
        said.append(f"Without a valid closing sample, left out: {', '.join(found.left_out)}.")
    return said


def _origin(side: Side) -> str:
    if side.origin is None:
        return f"{side.file} ({side.hash}) does not state what it was made from."
    origin = side.origin
    runs = f"{len(origin.data)} runs"
    made = f"{side.file} ({side.hash}): made {origin.made_at} by {origin.code} on {runs}"
    if origin.adapted_from:
        made += f", adapted from {origin.adapted_from}"
    if side.seen:
        made += (
            f". It was fitted on {len(side.seen)} of the runs compared on: its error is low there"
        )
    return made + "."


def tables(found: Comparison) -> list[TextTable]:
    """Return the errors over all runs, by condition and by run."""
    scale, unit, _ = in_shown_unit(unit_of(found.target))
    names = [side.file for side in found.sides]
    columns = [f"{found.target}, {unit}", "runs", *names, "ratio"]
    rows = [_row("all", found.runs, scale)]
    for name in WHERE:
        by_level: dict[float, list[RunErrors]] = {}
        for run in found.runs:
            if name in run.conditions:
                by_level.setdefault(run.conditions[name], []).append(run)
        if len(by_level) > 1:
            levels = sorted(by_level.items())
            rows += [_row(f"{name} {level:g}", runs, scale) for level, runs in levels]
    return [
        TextTable("RMS error on closing samples", columns, rows),
        _by_run(found, names, unit, scale),
    ]


def _row(name: str, runs: Sequence[RunErrors], scale: float) -> list[str]:
    count = np.array([run.samples for run in runs])
    a, b = (
        float(np.sqrt(np.average([run.rmse[k] ** 2 for run in runs], weights=count)))
        for k in range(2)
    )
    return [name, str(len(runs)), f"{scale * a:.3f}", f"{scale * b:.3f}", f"{b / a:.2f}"]


def _by_run(found: Comparison, names: Sequence[str], unit: str, scale: float) -> TextTable:
    rows = []
    for run in found.runs:
        shares = [f"{share:.0%}" if share is not None else "-" for share in run.covered]
        errors = [f"{scale * value:.3f}" for value in (*run.rmse, *run.mean)]
        rows.append([run.run, *errors, *shares])
    columns = [f"run, {unit}", *names, *(f"mean of {name}" for name in names)]
    columns += [f"{name} covers" for name in names]
    return TextTable("By run", columns, rows)
