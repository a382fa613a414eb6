"""Plots of an imported table: every channel over time, every other run shaded."""

import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from estimation.channels import unit_of
from estimation.files import write_bytes_atomic
from estimation.recording import FloatArray, Recording
from rig.output.figures import over_time
from rig.output.provenance import Provenance
from rig.output.render import render, write_report


def write_page(recordings: Sequence[Recording], path: Path) -> Path:
    """Write the plots as one HTML page."""
    time_s, shaded = _end_to_end(recordings)
    figures = [
        (name, over_time(time_s, {name: values}, unit_of(name), name, shaded))
        for name, values in _channels(recordings)
    ]
    context = {
        "title": "Imported table",
        "lead": f"{len(recordings)} runs, end to end; every other run is shaded.",
        "source": ", ".join(dict.fromkeys(recording.source for recording in recordings)),
        "notes": [],
        "tables": [],
        "figures": figures,
        "provenance": Provenance.now(0),
    }
    return write_report(path, render("study.html", context))


def write_picture(recordings: Sequence[Recording], path: Path) -> Path:
    """Write the plots as one PNG."""
    from matplotlib.figure import Figure

    time_s, shaded = _end_to_end(recordings)
    channels = _channels(recordings)
    figure = Figure(figsize=(10.0, 2.0 * len(channels)), layout="constrained")
    panels = figure.subplots(len(channels), 1, sharex=True, squeeze=False)[:, 0]
    for axis, (name, values) in zip(panels, channels, strict=True):
        axis.plot(time_s, values, linewidth=0.8)
        axis.fill_between(
            time_s, 0, 1, where=shaded, transform=axis.get_xaxis_transform(), alpha=0.2
        )
        axis.set_ylabel(name)
    panels[-1].set_xlabel("time, s, runs end to end")
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    write_bytes_atomic(path, buffer.getvalue())
    return path


def _channels(recordings: Sequence[Recording]) -> list[tuple[str, FloatArray]]:
    names = dict.fromkeys(name for recording in recordings for name in recording.columns)
    return [
        (name, np.concatenate([r.columns.get(name, np.full(len(r), np.nan)) for r in recordings]))
        for name in names
    ]


def _end_to_end(recordings: Sequence[Recording]) -> tuple[FloatArray, np.ndarray]:
    """Return the time of all runs one after the other, and which samples are of every other run."""
    parts, shaded, begin_s = [], [], 0.0
    for number, recording in enumerate(recordings):
        parts.append(begin_s + recording.time_s)
        shaded.append(np.full(len(recording), number % 2 == 1))
        begin_s += recording.duration_s + 1 / recording.sample_rate_hz
    return np.concatenate(parts), np.concatenate(shaded)
