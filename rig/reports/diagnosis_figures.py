"""Charts of a diagnosis: residual over each finding's variable, signals, errors by run."""

import math

import numpy as np

from estimation.channels import plain_name, unit_of
from estimation.diagnosis.result import Diagnosis, Error, Finding
from estimation.recording import FloatArray
from rig.diagnosis.traces import EquationTraces, RunTrace, Traces
from rig.output.charts import Chart, Line, axis, binned, line, numbers, thinned, trace
from rig.output.table import TextTable
from rig.reports.diagnosis_words import display

BINS = 48
SIDES = ("before", "after")
NAMES = {"before": "declared model", "after": "with the findings"}


def charts(diagnosis: Diagnosis, traces: Traces) -> list[Chart]:
    """Return the charts of a page, those of the findings first."""
    drawn = []
    for number, (finding, channels) in enumerate(
        zip(diagnosis.findings, traces.over, strict=False), start=1
    ):
        shown = traces.equations.get(finding.balance)
        for k, channel in enumerate(channels, start=1):
            if shown and all(channel in run.channels for run in shown.runs):
                drawn.append(_profile(f"residual-{number}-{k}", channel, finding, shown))
    for name, error in diagnosis.errors.items():
        drawn.append(_by_run(diagnosis, name, error))
        if name in traces.equations:
            drawn.append(_over_time(name, traces.equations[name], _sides(error)))
    return drawn


def _sides(error: Error) -> tuple[str, ...]:
    """Return the models to draw: the declared one alone where no finding changes the error."""
    return SIDES if error.by_run_before != error.by_run_after else SIDES[:1]


def _profile(name: str, channel: str, finding: Finding, shown: EquationTraces) -> Chart:
    """Draw the residual of the held-out test runs over one channel, before and after."""
    label, x_unit = plain_name(channel), unit_of(channel)
    runs = shown.runs
    periodic = "order" in finding.parameters
    scale, unit = display(shown.model.unit, max(float(np.max(np.abs(r.before))) for r in runs))
    lines: list[Line] = []
    rows: dict[float, list[str]] = {}
    height = {}
    for side in SIDES:
        values = [scale * getattr(r, side) for r in runs]
        places = [_within_a_turn(r.channels[channel], periodic) for r in runs]
        x, mean, low, high = binned(np.concatenate(places), np.concatenate(values), BINS)
        lines += _with_band(x, (mean, low, high), side, unit)
        for run, place, value in zip(runs, places, values, strict=True):
            own_x, own_mean, _, _ = binned(place, value, BINS)
            meta = {"role": side, "run": run.run}
            lines.append(line(own_x, own_mean, f"{side}, {run.run}", meta, unit, legend=False))
        height[side] = float(mean.max() - mean.min()) if len(mean) else 0.0
        for place, one, below, above in zip(x, mean, low, high, strict=True):
            row = rows.setdefault(float(f"{place:.3g}"), [f"{place:.3g}"])
            row += [f"{one:.3g}", f"{below:.3g} to {above:.3g}"]
    of_turn = ", within a turn" if periodic and "angle" in channel else ""
    title = f"{shown.model.balance}: residual over {label}{of_turn}"
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
        "xaxis": axis(f"{label}{of_turn}, {x_unit}", x_unit),
        "yaxis": {"title": {"text": f"residual, {unit}"}},
    }
    table = TextTable(f"{title}, {unit}", columns, full)
    return Chart(name, title, judgement, caption, layout, lines, table=table)


def _within_a_turn(values: FloatArray, periodic: bool) -> FloatArray:
    """Return angles of a periodic effect within one turn, where runs cover two turns and more."""
    if periodic and float(np.ptp(values)) > 4 * math.pi:
        return np.mod(values, 2 * math.pi)
    return values


def _with_band(
    x: FloatArray, values: tuple[FloatArray, FloatArray, FloatArray], side: str, unit: str
) -> list[Line]:
    """Return a mean with a band, the band first so that it lies behind."""
    mean, low, high = values
    band = {"role": side, "band": True}
    lower = line(x, low, f"{side}, 5 %", band, unit, legend=False)
    upper = line(x, high, f"{side}, 95 %", band, unit, legend=False)
    return [lower, {**upper, "fill": "tonexty"}, line(x, mean, NAMES[side], {"role": side}, unit)]


def _by_run(diagnosis: Diagnosis, name: str, error: Error) -> Chart:
    scale, unit = display(diagnosis.unit[name], error.before)
    lines: list[Line] = []
    by_side = {"before": error.by_run_before, "after": error.by_run_after}
    hover = f"%{{y:.3g}} {unit}"
    for side in _sides(error):
        by_run = by_side[side]
        values = numbers(scale * np.array(list(by_run.values())))
        lines.append(trace("bar", list(by_run), values, NAMES[side], side, hovertemplate=hover))
    floor = diagnosis.noise_floor.get(name)
    if floor is not None and error.by_run_before:
        runs = list(error.by_run_before)
        ends, level = [runs[0], runs[-1]], [scale * floor] * 2
        more = {"mode": "lines", "hovertemplate": hover}
        lines.append(trace("scatter", ends, level, "noise floor", "level", **more))
    better = sum(error.by_run_after[run] < one for run, one in error.by_run_before.items())
    judgement = (
        f"The error is lower in {better} of {len(error.by_run_before)} held-out test runs:"
        f" {scale * error.before:.3g} {unit} overall with the declared model,"
        f" {scale * error.after:.3g} {unit} with the findings."
    )
    if _sides(error) != SIDES:
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
        "Root mean square over a run's samples that the equation counts, its mean removed.",
        layout,
        lines,
        table=TextTable(f"{title}, {unit}", ["run", "before", "after"], rows),
    )


def _over_time(name: str, shown: EquationTraces, sides: tuple[str, ...]) -> Chart:
    """Draw measured and estimated signal and the residual of one run, which a reader chooses."""
    scale, unit = display(shown.model.unit, float(np.max(np.abs(shown.runs[0].measured))))
    label = plain_name(shown.model.target)
    runs = sorted(shown.runs, key=lambda run: float(np.std(run.after)))
    middle = runs.pop(len(runs) // 2)
    choices = {run.run: _signals(run, scale, unit, sides) for run in (middle, *runs)}
    layout = {
        "xaxis": {**axis("time, s", "s"), "anchor": "y2"},
        "yaxis": {"title": {"text": f"{label}, {unit}"}, "domain": [0.42, 1]},
        "yaxis2": {"title": {"text": f"residual, {unit}"}, "domain": [0, 0.36]},
        "hoversubplots": "axis",
        "height": 460,
    }
    caption = (
        "Measured and estimated signal of one held-out test run, above, and measured minus"
        " estimated, below; zero-phase filtered, the run's mean error removed. Gaps: samples at"
        " standstill, at the ends of the run or flagged, which the error does not count."
    )
    title = f"{name}: measured and estimated"
    return Chart(f"time-{name}", title, "", caption, layout, choices=choices)


def _signals(run: RunTrace, scale: float, unit: str, sides: tuple[str, ...]) -> list[Line]:
    gaps = np.diff(run.time_s, prepend=run.time_s[0]) > 3 * np.median(np.diff(run.time_s))
    measured = scale * run.measured
    left = {side: np.where(gaps, np.nan, scale * getattr(run, side)) for side in sides}
    time_s = thinned(run.time_s)
    lines: list[Line] = [line(time_s, thinned(measured), "measured", {"role": "measured"}, unit)]
    for side in sides:
        values = thinned(measured - left[side])
        lines.append(line(time_s, values, NAMES[side], {"role": side}, unit))
    for side in sides:
        residual = thinned(left[side])
        one = line(time_s, residual, f"residual, {NAMES[side]}", {"role": side}, unit)
        lines.append({**one, "yaxis": "y2", "showlegend": False})
    return lines
