"""Charts of a diagnosis: residual over each finding's variable, signals, errors by run."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from estimation.channels import UNIT_BY_SUFFIX, unit_of
from estimation.diagnosis.result import Diagnosis, Error, Finding
from estimation.model import Term
from estimation.recording import FloatArray
from rig.diagnosis.traces import EquationTraces, RunTrace
from rig.output.binning import binned
from rig.output.charts import Chart, Line, numbers, thinned
from rig.output.table import TextTable
from rig.reports.diagnosis_words import display

BINS = 48
MOST_PANELS = 2
"""Most channels of one finding that its residual is drawn over."""


def charts(diagnosis: Diagnosis, traces: Mapping[str, EquationTraces]) -> list[Chart]:
    """Return the charts of a page, those of the findings first."""
    drawn = []
    for number, finding in enumerate(diagnosis.findings, start=1):
        if finding.balance in traces:
            drawn += _over_channels(number, finding, traces[finding.balance])
    for name, error in diagnosis.errors.items():
        drawn.append(_by_run(diagnosis, name, error))
        if name in traces and traces[name].held_out:
            drawn.append(_over_time(name, traces[name]))
    return drawn


def _words(channel: str) -> tuple[str, str]:
    """Return a channel's name without its unit's suffix, and that unit."""
    parts = channel.split("_")
    stem = next(k for k in range(1, len(parts)) if "_".join(parts[k:]) in UNIT_BY_SUFFIX)
    return " ".join(parts[:stem]), unit_of(channel)


def _over_channels(number: int, finding: Finding, shown: EquationTraces) -> list[Chart]:
    terms = [t for t in shown.added if t.effect.family.split(".")[0] == _kind(finding)]
    own = [t for t in terms if t.effect.family == finding.family] or terms
    channels = dict.fromkeys(c for t in own for c in t.channels.values() if c != "time_s")
    return [
        _profile(f"residual-{number}-{k}", channel, own, shown)
        for k, channel in enumerate(list(channels)[:MOST_PANELS], start=1)
    ]


def _kind(finding: Finding) -> str:
    return finding.family.split(".")[0]


def _profile(name: str, channel: str, terms: Sequence[Term], shown: EquationTraces) -> Chart:
    """Draw the residual of the held-out test runs over one channel, before and after."""
    label, x_unit = _words(channel)
    runs = shown.held_out or shown.runs
    periodic = any("order" in [p.name for p in t.parameters] for t in terms)
    scale, unit = display(shown.after.unit)
    lines: list[Line] = []
    rows: dict[float, list[str]] = {}
    height = {}
    for side in ("before", "after"):
        values = [scale * (r.measured - getattr(r, side))[r.counted] for r in runs]
        places = [_within_a_turn(r.channels[channel][r.counted], periodic) for r in runs]
        x, mean, low, high = binned(np.concatenate(places), np.concatenate(values), BINS)
        lines += _with_band(x, (mean, low, high), side, unit)
        for run, place, value in zip(runs, places, values, strict=True):
            own_x, own_mean, _, _ = binned(place, value, BINS)
            meta = {"role": side, "run": run.run}
            lines.append(_line(own_x, own_mean, f"{side}, {run.run}", meta, unit, legend=False))
        height[side] = float(mean.max() - mean.min()) if len(mean) else 0.0
        for place, one, below, above in zip(x, mean, low, high, strict=True):
            row = rows.setdefault(float(f"{place:.3g}"), [f"{place:.3g}"])
            row += [f"{one:.3g}", f"{below:.3g} to {above:.3g}"]
    of_turn = ", within a turn" if periodic and "angle" in channel else ""
    title = f"{shown.after.balance}: residual over {label}{of_turn}"
    judgement = (
        f"The mean residual varies by {height['before']:.3g} {unit} over {label} with the declared"
        f" model and by {height['after']:.3g} {unit} with the findings."
    )
    caption = (
        "Held-out test runs. Thick: mean of all runs; shaded: the middle 90 % of the samples;"
        " thin: each run by itself."
    )
    columns = [f"{label}, {x_unit}", "before", "90 %", "after", "90 %"]
    full = [row for row in rows.values() if len(row) == len(columns)]
    layout = {
        "xaxis": _axis(f"{label}{of_turn}, {x_unit}", x_unit),
        "yaxis": {"title": {"text": f"residual, {unit}"}},
    }
    table = TextTable(f"{title}, {unit}", columns, full)
    return Chart(name, title, judgement, caption, layout, lines, table=table)


def _within_a_turn(values: FloatArray, periodic: bool) -> FloatArray:
    """Return angles of a periodic effect within one turn, where runs cover two turns and more."""
    if periodic and float(np.ptp(values)) > 4 * math.pi:
        return np.mod(values, 2 * math.pi)
    return values


def _axis(title: str, unit: str) -> dict[str, Any]:
    return {
        "title": {"text": title},
        "zeroline": False,
        "unifiedhovertitle": {"text": f"%{{x:.4g}} {unit}"},
    }


def _line(
    x: FloatArray, y: FloatArray, name: str, meta: Line, unit: str, *, legend: bool = True
) -> dict[str, Any]:
    return {
        "type": "scatter",
        "mode": "lines",
        "x": numbers(x),
        "y": numbers(y),
        "name": name,
        "meta": meta,
        "showlegend": legend,
        "hoverinfo": "all" if legend else "skip",
        "hovertemplate": f"%{{y:.3g}} {unit}" if legend else None,
    }


def _with_band(
    x: FloatArray, values: tuple[FloatArray, FloatArray, FloatArray], side: str, unit: str
) -> list[Line]:
    """Return a mean with a band, the band first so that it lies behind."""
    mean, low, high = values
    band = {"role": side, "band": True}
    lower = _line(x, low, f"{side}, 5 %", band, unit, legend=False)
    upper = _line(x, high, f"{side}, 95 %", band, unit, legend=False)
    name = {"before": "declared model", "after": "with the findings"}[side]
    return [lower, {**upper, "fill": "tonexty"}, _line(x, mean, name, {"role": side}, unit)]


def _by_run(diagnosis: Diagnosis, name: str, error: Error) -> Chart:
    """Draw the error of each held-out test run before and after."""
    scale, unit = display(diagnosis.unit[name])
    lines: list[Line] = []
    names = {"before": "declared model", "after": "with the findings"}
    for side, by_run in (("before", error.by_run_before), ("after", error.by_run_after)):
        lines.append(
            {
                "type": "bar",
                "x": list(by_run),
                "y": numbers(scale * np.array(list(by_run.values()))),
                "name": names[side],
                "meta": {"role": side},
                "hovertemplate": f"%{{y:.3g}} {unit}",
            }
        )
    floor = diagnosis.noise_floor.get(name)
    if floor is not None and error.by_run_before:
        runs = list(error.by_run_before)
        level = {
            "type": "scatter",
            "mode": "lines",
            "x": [runs[0], runs[-1]],
            "y": [scale * floor] * 2,
            "name": "noise floor",
            "meta": {"role": "level"},
            "hovertemplate": f"%{{y:.3g}} {unit}",
        }
        lines.append(level)
    better = sum(error.by_run_after[run] < one for run, one in error.by_run_before.items())
    judgement = (
        f"The error is lower in {better} of {len(error.by_run_before)} held-out test runs:"
        f" {scale * error.before:.3g} {unit} overall with the declared model,"
        f" {scale * error.after:.3g} {unit} with the findings."
    )
    if not diagnosis.findings:
        judgement = f"The declared model's error is {scale * error.before:.3g} {unit} overall."
    title = f"{name}: error of each held-out test run"
    rows = [
        [run, f"{scale * one:.3g}", f"{scale * error.by_run_after[run]:.3g}"]
        for run, one in error.by_run_before.items()
    ]
    layout = {
        "xaxis": {"type": "category", "tickangle": "auto"},
        "yaxis": {"title": {"text": f"rms error, {unit}"}, "rangemode": "tozero"},
        "height": 320,
    }
    return Chart(
        f"errors-{name}",
        title,
        judgement,
        "Root mean square over all valid samples of a run, its mean removed.",
        layout,
        lines,
        table=TextTable(f"{title}, {unit}", ["run", "before", "after"], rows),
    )


def _over_time(name: str, shown: EquationTraces) -> Chart:
    """Draw measured and estimated signal and the residual of one run, which a reader chooses."""
    scale, unit = display(shown.after.unit)
    label, _ = _words(shown.after.target)
    runs = sorted(shown.held_out, key=_error_after)
    middle = runs.pop(len(runs) // 2)
    choices = {run.run: _signals(run, scale, unit) for run in (middle, *runs)}
    layout = {
        "xaxis": {**_axis("time, s", "s"), "anchor": "y2"},
        "yaxis": {"title": {"text": f"{label}, {unit}"}, "domain": [0.42, 1]},
        "yaxis2": {"title": {"text": f"residual, {unit}"}, "domain": [0, 0.36]},
        "hoversubplots": "axis",
        "height": 460,
    }
    caption = (
        "Measured and estimated signal of one held-out test run, above, and measured minus"
        " estimated, below; zero-phase filtered, the run's mean error removed. Gaps: samples at"
        " standstill, at the ends of the run or flagged, which the fit does not count."
    )
    title = f"{name}: measured and estimated"
    return Chart(f"time-{name}", title, "", caption, layout, choices=choices)


def _error_after(run: RunTrace) -> float:
    return float(np.std((run.measured - run.after)[run.counted]))


def _signals(run: RunTrace, scale: float, unit: str) -> list[Line]:
    kept = {
        "measured": run.measured,
        "before": np.where(run.counted, run.before, np.nan),
        "after": np.where(run.counted, run.after, np.nan),
    }
    names = {"measured": "measured", "before": "declared model", "after": "with the findings"}
    time_s = thinned(run.time_s)
    lines = []
    for role, values in kept.items():
        meta = {"role": role}
        lines.append(_line(time_s, thinned(scale * values), names[role], meta, unit))
    for role in ("before", "after"):
        left = thinned(scale * (run.measured - kept[role]))
        line = _line(time_s, left, f"residual, {names[role]}", {"role": role}, unit)
        lines.append({**line, "yaxis": "y2", "showlegend": False})
    return [{**line, "x": numbers(time_s, 6)} for line in lines]
