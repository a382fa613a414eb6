"""Recordings as one interactive page: every channel over time, and estimates on their sensors."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from estimation.campaign import Campaign
from estimation.channels import ESTIMATED, plain_name, unit_of
from estimation.recording import FloatArray, Recording
from rig.output.charts import Chart, axis, line, render, thinned
from rig.output.provenance import Provenance
from rig.output.table import TextTable, listed
from rig.reports.diagnosis_words import display

NUMBERS = 400_000
"""Numbers in a page, about: 3 MB."""
LEAST_POINTS, MOST_POINTS = 300, 20_000
PANEL_PX, FRAME_PX = 190, 120
GAP = 0.2
"""Share of a panel's height that is left free below it."""
COLOURS = 6
"""Colours of channels in `charts.js`."""


def page(campaign: Campaign, title: str, provenance: Provenance) -> str:
    """Return the page of HTML, which needs nothing outside itself.

    Runs left out of evidence are on it too; one run is held at a time.
    """
    drawn: dict[str, list[dict[str, Any]]] = {}
    rows = []
    for run in campaign:
        share = NUMBERS // (len(campaign) * max(1, len(run.columns)))
        drawn[run.name] = _lines(run, int(np.clip(share, LEAST_POINTS, MOST_POINTS)))
        rows.append(_row(run))
    panels = list(dict.fromkeys(one["meta"]["panel"] for run in drawn.values() for one in run))
    for one in (one for run in drawn.values() for one in run):
        one["yaxis"] = _axis_name("y", panels.index(one["meta"]["panel"]) + 1)
    most = max((len(one["x"]) for run in drawn.values() for one in run), default=0)
    caption = (
        "Drag to zoom; double-click for the whole; click on a name to hide it. At most"
        f" {most:,} samples of a run are drawn, at equal distances."
    )
    chart = Chart(
        "time-recordings", "Channels over time", "", caption, _layout(panels), choices=drawn
    )
    columns = ["run", "s", "Hz", "flagged samples", "conditions", "marks", "notes"]
    return render(
        "recordings.html",
        {
            "title": title,
            "runs": TextTable("Runs", columns, rows),
            "charts": [chart],
            "provenance": provenance,
        },
    )


def _lines(run: Recording, points: int) -> list[dict[str, Any]]:
    """Return each channel of a run as a line whose `meta` names its panel."""
    time_s = thinned(run.time_s, points)
    drawn: list[dict[str, Any]] = []

    def add(name: str, values: FloatArray, unit: str, panel: str, role: str = "") -> None:
        meta = {"role": role or f"channel{len(drawn) % COLOURS}", "panel": panel}
        drawn.append(line(time_s, thinned(values, points), name, meta, unit))

    for name, values in run.columns.items():
        scale, unit = _shown(run, name)
        role = "after" if name.startswith(ESTIMATED) else ""
        add(plain_name(name), scale * values, unit, "ratio" if unit == "1" else unit, role)
    for name, values in run.columns.items():
        target = name.removeprefix(ESTIMATED)
        if target != name and target in run.columns:
            scale, unit = _shown(run, name)
            left = scale * (run.columns[target] - values)
            label = f"{plain_name(target)}, measured - estimated"
            add(label, left, unit, f"residual, {unit}", "before")
    if run.flags.any():
        add("flags", run.flags.astype(np.float64), "", "1 saturated, 2 stale, 4 missing, 8 suspect")
    return drawn


def _axis_name(stem: str, number: int) -> str:
    return stem if number == 1 else f"{stem}{number}"


def _layout(panels: Sequence[str]) -> dict[str, Any]:
    count = len(panels)
    layout: dict[str, Any] = {
        "xaxis": {**axis("time, s", "s"), "anchor": _axis_name("y", count)},
        "hoversubplots": "axis",
        "uirevision": "kept",  # zoom and hidden names stay when another run is chosen
        "height": FRAME_PX + PANEL_PX * count,
    }
    for number, panel in enumerate(panels, start=1):
        top = 1 - (number - 1) / count
        domain = [max(0.0, top - (1 - GAP * (number < count)) / count), top]
        layout[_axis_name("yaxis", number)] = {"title": {"text": panel}, "domain": domain}
    return layout


def _row(run: Recording) -> list[str]:
    return [
        run.name,
        f"{run.duration_s:.4g}",
        f"{run.sample_rate_hz:.4g}" if len(run) > 1 else "",
        str(int((run.flags != 0).sum())),
        listed(run.conditions),
        ", ".join(f"{mark.text} at {mark.time_s:g} s" for mark in run.marks),
        " ".join(filter(None, (run.notes, run.excluded and f"Left out: {run.excluded}"))),
    ]


def _shown(run: Recording, name: str) -> tuple[float, str]:
    """Return factor and unit of a channel; an estimate has those of what it estimates."""
    like = run.columns.get(name.removeprefix(ESTIMATED), run.columns[name])
    return display(unit_of(name), float(np.nanmax(np.abs(like), initial=0.0)))
