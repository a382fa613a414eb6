"""Figures as SVG files: functions of arrays, drawn without a display and without global state."""

import io
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from estimation.files import write_text_atomic
from estimation.recording import FloatArray
from rig.output.charts import binned, thinned

COLOURS = ("#3b7dd8", "#d9822b", "#2e9e6b", "#b04fc4")
"""Told apart in light and in dark, and by eyes that mix up red and green."""

_INK = "#555555"  # reads on light and dark pages
_STYLE: dict[Any, Any] = {
    "svg.fonttype": "none",  # text stays text: small, searchable, in a font of the reader's
    "svg.hashsalt": "rig",  # the same figure is the same file
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.8,
    "legend.frameon": False,
    **dict.fromkeys(
        ("text.color", "axes.labelcolor", "axes.edgecolor", "xtick.color", "ytick.color"), _INK
    ),
}
POINTS = 1500
"""Most points a line is drawn with."""

LETTERS = 100
"""Names of a bar chart stand side by side up to so many letters together, then upright."""


def _drawn(figure: Figure, caption: str) -> str:
    """Return a figure as the text of an SVG file, with its caption as title."""
    buffer = io.StringIO()
    unstated = dict.fromkeys(("Creator", "Date", "Format", "Type"))
    figure.savefig(buffer, format="svg", metadata={"Title": caption, **unstated})
    text = buffer.getvalue()
    # without a size of its own it is as wide as the page
    return re.sub(r' (?:width|height)="[^"]*pt"', "", text[text.index("<svg") :], count=2)


def _axes(height_in: float, columns: int = 1) -> tuple[Figure, list[Axes]]:
    figure = Figure(figsize=(7.2, height_in), layout="constrained")
    figure.patch.set_alpha(0.0)
    axes = [figure.add_subplot(1, columns, k + 1) for k in range(columns)]
    for ax in axes:
        ax.patch.set_alpha(0.0)
        ax.grid(visible=True, color="#8888", linewidth=0.4)
    return figure, axes


def _legend_above(ax: Axes) -> None:
    """Put the legend on one line above the axes, where it hides no data."""
    ax.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.0, ncols=4)


@mpl.rc_context(_STYLE)
def over_time(time_s: FloatArray, series: Mapping[str, FloatArray], unit: str, caption: str) -> str:
    """Draw signals of a unit over time, by name, each of shape (n,); NaN makes a gap.

    The caption of any figure describes it for readers who cannot see it.
    """
    figure, (ax,) = _axes(2.6)
    time = thinned(time_s, POINTS)
    for colour, (name, values) in zip(COLOURS, series.items(), strict=False):
        ax.plot(time, thinned(values, POINTS), color=colour, linewidth=1.1, label=name)
    ax.set_xlabel("time, s")
    ax.set_ylabel(unit)
    ax.margins(x=0)
    _legend_above(ax)
    return _drawn(figure, caption)


@mpl.rc_context(_STYLE)
def against(
    variables: Mapping[str, FloatArray],
    before: FloatArray,
    after: FloatArray,
    y_label: str,
    caption: str,
) -> str:
    """Draw values against several variables: mean and the middle 90 % in each of 24 bins.

    Variables, by name and unit, and values have shape (n,). The panels stand side by side, on one
    scale. The bins are those of `binned`.
    """
    figure, axes = _axes(2.5, len(variables))
    series = [("before", before, COLOURS[1]), ("after", after, COLOURS[0])]
    for ax, (label, variable) in zip(axes, variables.items(), strict=True):
        for name, values, colour in series:
            x, mean, low, high = binned(variable, values, 24)
            ax.fill_between(x, low, high, color=colour, alpha=0.25, linewidth=0)
            ax.plot(x, mean, color=colour, linewidth=1.4, label=name)
        ax.axhline(0, color=_INK, linewidth=0.6)
        ax.set_xlabel(label)
    axes[0].set_ylabel(y_label)
    _legend_above(axes[0])
    limits = [ax.get_ylim() for ax in axes]
    for ax in axes:
        ax.set_ylim(min(low for low, _ in limits), max(high for _, high in limits))
    return _drawn(figure, caption)


def bars(values: Mapping[str, float], unit: str, caption: str) -> str:
    """Draw one bar a name."""
    named = {name.replace("_", " "): (value,) for name, value in values.items()}
    return paired_bars(named, ("",), unit, caption)


@mpl.rc_context(_STYLE)
def paired_bars(
    values: Mapping[str, Sequence[float]], sides: Sequence[str], unit: str, caption: str
) -> str:
    """Draw the bars of each name next to one another, one for each side."""
    figure, (ax,) = _axes(2.2)
    place, step = np.arange(len(values)), 0.72 / len(sides)
    for k, (side, colour) in enumerate(zip(sides, COLOURS, strict=False)):
        at = place + step * (k - (len(sides) - 1) / 2)
        heights = [own[k] for own in values.values()]
        ax.bar(at, heights, color=colour, width=0.94 * step, label=side)
    crowded = sum(map(len, values)) > LETTERS
    ax.set_xticks(place, list(values), rotation=90 if crowded else 0, fontsize=7)
    ax.grid(visible=False, axis="x")
    ax.set_ylabel(unit)
    if len(sides) > 1:
        _legend_above(ax)
    return _drawn(figure, caption)


@mpl.rc_context(_STYLE)
def scattered(
    series: Mapping[str, tuple[FloatArray, FloatArray]], x_label: str, y_label: str, caption: str
) -> str:
    """Draw points, one colour a series of x and y, and a line at zero."""
    figure, (ax,) = _axes(2.6)
    for number, (name, (x, y)) in enumerate(series.items()):
        step = max(1, len(x) // 400)
        colour = COLOURS[number % len(COLOURS)]
        ax.plot(x[::step], y[::step], ".", markersize=3, color=colour, label=name)
    ax.axhline(0, color=_INK, linewidth=0.6)
    ax.set_xlabel(x_label)
    ax.set_ylabel(y_label)
    if len(series) <= len(COLOURS):
        _legend_above(ax)
    return _drawn(figure, caption)


def write_svgs(folder: Path, drawn: Mapping[str, str]) -> list[Path]:
    """Write figures by name as files."""
    paths = [folder / f"{name}.svg" for name in drawn]
    for path, figure in zip(paths, drawn.values(), strict=True):
        write_text_atomic(path, figure)
    return paths
