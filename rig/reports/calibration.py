"""A calibration as one page: result and uncertainty, comparison with earlier ones, residuals."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from calibration.history import COVERAGE, changes, deviation, earlier_ones
from calibration.procedure import Conclusion, Residuals
from calibration.record import CalibrationRecord
from rig.calibrate.shown import parameter_unit, with_unit
from rig.output.charts import Chart, Line, numbers, render, thinned, trace
from rig.output.provenance import Provenance
from rig.output.table import TextTable


def page(
    records: Mapping[str, CalibrationRecord],
    conclusion: Conclusion,
    stored: Sequence[CalibrationRecord],
    provenance: Provenance,
) -> str:
    """Return the page of HTML: records of a session by hash, held against all of the store."""
    first = next(iter(records.values()))
    charts = [_residuals(conclusion.residuals)]
    tables = []
    for record in records.values():
        earlier = earlier_ones(record, stored)
        tables.append(_parameters(record, earlier))
        charts += _history(record, earlier)
    return render(
        "calibration.html",
        {
            "title": f"Calibration: {first.kind}",
            "alarms": alarms(records.values(), stored),
            "facts": _facts(records),
            "charts": charts,
            "tables": tables,
            "provenance": provenance,
        },
    )


def alarms(records: Any, stored: Sequence[CalibrationRecord]) -> list[str]:
    """Return a sentence for each parameter that drifted since the calibration before."""
    said = []
    for record in records:
        earlier = earlier_ones(record, stored)
        for change in changes(earlier[0], record) if earlier else ():
            if not change.drifted:
                continue
            unit = parameter_unit(change.parameter, record)
            said.append(
                f"{record.channel}, {change.parameter} drifted: {with_unit(change.now, unit)} now,"
                f" {with_unit(change.earlier, unit)} on {earlier[0].made_at[:10]};"
                f" {change.normalised_error:.1f} times the expanded uncertainty of the difference."
                " Check mounting and cable, then calibrate again."
            )
    return said


def _facts(records: Mapping[str, CalibrationRecord]) -> list[tuple[str, str]]:
    first = next(iter(records.values()))
    facts = [
        ("Made", f"{first.made_at} by {first.operator}"),
        ("Records", ", ".join(f"{digest} ({r.channel})" for digest, r in records.items())),
    ]
    if first.serials:
        facts.append(("Serials", ", ".join(f"{k} {v}" for k, v in first.serials.items())))
    if first.notes:
        facts.append(("Notes", first.notes))
    return facts


def _parameters(record: CalibrationRecord, earlier: Sequence[CalibrationRecord]) -> TextTable:
    compared = {c.parameter: c for c in changes(earlier[0], record)} if earlier else {}
    rows = []
    for name, value in record.fit.parameters.items():
        unit = parameter_unit(name, record)
        spread = deviation(record, name)
        shown = "" if spread is None else with_unit(COVERAGE * spread, unit)
        before, error = "", ""
        if name in compared:
            before = with_unit(compared[name].earlier, unit)
            normalised = compared[name].normalised_error
            error = "" if normalised is None else f"{normalised:.2f}"
        rows.append([name, with_unit(value, unit), shown, before, error])
    note = (
        "Uncertainty: two standard deviations. E_n: difference from the calibration before over its"
        " expanded uncertainty; above 1 the two disagree."
    )
    if record.fit.residual_rms is not None:
        unit = parameter_unit(record.channel, record)
        note = f"Residual {with_unit(record.fit.residual_rms, unit)} rms. {note}"
    columns = ["parameter", "value", "uncertainty", "before", "E_n"]
    return TextTable(f"{record.channel} from {record.input}", columns, rows, note)


def _residuals(residuals: Residuals) -> Chart:
    marks = {"mode": "markers", "showlegend": False}
    lines: list[Line] = [
        trace("scatter", numbers(thinned(x)), numbers(thinned(y)), name, "after", **marks)
        for name, (x, y) in residuals.series.items()
    ]
    rows = [
        [name, f"{float(np.mean(y)):.3g}", f"{float(np.std(y)):.3g}"]
        for name, (_, y) in residuals.series.items()
    ]
    layout = {
        "xaxis": {"title": {"text": residuals.label}, "zeroline": False},
        "yaxis": {"title": {"text": residuals.unit}},
        "hovermode": "closest",
    }
    table = TextTable("Residual of each step", ["step", "mean", "standard deviation"], rows)
    caption = "Residual of the fit, one mark for each point; hover a mark for its step."
    return Chart("residuals", "Residuals", "", caption, layout, lines, table=table)


def _history(record: CalibrationRecord, earlier: Sequence[CalibrationRecord]) -> list[Chart]:
    """Draw each parameter over the last calibrations, with its expanded uncertainty."""
    drawn = []
    whole = [*reversed(earlier), record]
    for name in record.fit.parameters if earlier else ():
        known = [one for one in whole if name in one.fit.parameters]
        unit = parameter_unit(name, record)
        values = [one.fit.parameters[name] for one in known]
        bars = [COVERAGE * (deviation(one, name) or 0.0) for one in known]
        hover = f"%{{y:.5g}} {unit}<extra></extra>"
        errors = {"type": "data", "array": bars, "visible": True}
        more = {"mode": "markers", "error_y": errors, "hovertemplate": hover}
        line = trace("scatter", [one.made_at for one in known], values, name, "after", **more)
        rows = [
            [one.made_at, with_unit(value, unit), with_unit(bar, unit), one.operator]
            for one, value, bar in zip(known, values, bars, strict=True)
        ]
        title = f"{record.channel}: {name} over the last calibrations"
        layout = {
            "xaxis": {"type": "date"},
            "yaxis": {"title": {"text": f"{name}, {unit}" if unit else name}},
            "height": 280,
        }
        columns = ["made", "value", "uncertainty", "operator"]
        drawn.append(
            Chart(
                f"history-{record.channel}-{name}",
                title,
                "",
                "Bars: expanded uncertainty, two standard deviations.",
                layout,
                [line],
                table=TextTable(title, columns, rows),
            )
        )
    return drawn
