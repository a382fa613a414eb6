"""Pages of HTML that need nothing else, no network, one style for paper and screen.

Their charts are plain data that the Plotly library, inside the page, draws. A chart has the numbers
it shows as a table too, for readers who cannot see it.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib import resources
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from estimation.recording import FloatArray
from rig.output.table import TextTable

POINTS = 1200
"""Most points a line is drawn with."""

Line = Mapping[str, Any]
"""A trace of Plotly. Its `meta` has the `role` (`before`, `after`, `measured`, `level`,
`channel0` to `channel5`), which sets its colour, and the `run` it belongs to, if one."""


@dataclass(frozen=True)
class Chart:
    """One chart."""

    name: str  # id in the page and name of exported files
    title: str
    judgement: str  # conclusion that the chart supports, in a sentence
    caption: str
    layout: Mapping[str, Any]  # axes, as Plotly has them
    lines: Sequence[Line] = ()  # what is drawn
    # name to what is drawn once it is chosen, in place of `lines`; empty without choice
    choices: Mapping[str, Sequence[Line]] = field(default_factory=dict)
    table: TextTable | None = None  # its numbers


def numbers(values: FloatArray, digits: int = 5) -> list[float | None]:
    """Return values for a chart, rounded to significant digits; None where not finite."""
    finite = np.isfinite(values)
    return [float(f"{v:.{digits}g}") if ok else None for v, ok in zip(values, finite, strict=True)]


def thinned(values: FloatArray, points: int = POINTS) -> FloatArray:
    """Return every n-th value, so that at most `points` are left."""
    return values[:: max(1, -(-len(values) // points))]


def binned(
    x: FloatArray, y: FloatArray, bins: int
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return bin centres, mean, 5th and 95th percentile of y over bins of x, both of shape (n,).

    The bins cover the middle 98 % of x; those with under ten samples are left out.
    """
    low, high = np.percentile(x, [1, 99])
    edges = np.linspace(low, high if high > low else low + 1.0, bins + 1)
    place = np.clip(np.digitize(x, edges) - 1, 0, bins - 1)
    full = [k for k in range(bins) if np.count_nonzero(place == k) >= 10]
    parts = [y[place == k] for k in full]
    centres = (edges[:-1] + edges[1:])[full] / 2
    mean = np.array([part.mean() for part in parts])
    spread = np.array([np.percentile(part, [5, 95]) for part in parts]).reshape(-1, 2)
    return centres, mean, spread[:, 0], spread[:, 1]


def axis(title: str, unit: str) -> dict[str, Any]:
    """Return an axis of a variable, for a layout."""
    return {
        "title": {"text": title},
        "zeroline": False,
        "unifiedhovertitle": {"text": f"%{{x:.4g}} {unit}"},
    }


def line(
    x: FloatArray, y: FloatArray, name: str, meta: Line, unit: str, *, legend: bool = True
) -> dict[str, Any]:
    """Return a line; without an entry in the legend it has no text on hover either."""
    return {
        "type": "scatter",
        "mode": "lines",
        "x": numbers(x, 6),
        "y": numbers(y),
        "name": name,
        "meta": meta,
        "showlegend": legend,
        "hoverinfo": "all" if legend else "skip",
        "hovertemplate": f"%{{y:.3g}} {unit}" if legend else None,
    }


def trace(
    kind: str, x: Sequence[Any], y: Sequence[Any], name: str, role: str, **more: Any
) -> dict[str, Any]:
    """Return a trace of a kind of Plotly's, coloured by its role."""
    return {"type": kind, "x": x, "y": y, "name": name, "meta": {"role": role}, **more}


@cache
def _environment() -> Environment:
    return Environment(
        loader=PackageLoader("rig.output"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def render(template: str, context: Mapping[str, Any]) -> str:
    """Fill a template of this package, such as `diagnosis.html`, and put its charts into it.

    Text is escaped. `charts` of the context are drawn by the page.

    Raises:
        jinja2.UndefinedError: The template uses a name that the context lacks.
    """
    drawn = {"data": _embedded(context["charts"]), "script": _scripts()}
    return _environment().get_template(template).render({**context, **drawn})


def _embedded(charts: Sequence[Chart]) -> Markup:
    """Return the data of charts as JSON that may stand inside a script element."""
    names = ("name", "title", "layout", "lines", "choices")
    plain = [{name: getattr(chart, name) for name in names} for chart in charts]
    text = json.dumps(plain, allow_nan=False, separators=(",", ":"))
    return Markup(text.replace("<", "\\u003c"))  # noqa: S704 - no tag can begin in it


def _scripts() -> Markup:
    """Return the drawing library and the code that draws a page's charts with it."""
    folder = resources.files("rig.output") / "assets"
    texts = [(folder / name).read_text("utf-8") for name in ("plotly-basic.min.js", "charts.js")]
    return Markup("\n".join(texts))  # noqa: S704 - files of this package
