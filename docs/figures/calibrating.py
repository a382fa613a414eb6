"""Draw `docs/figures/calibration-KIND.svg`: the set-up of each calibration, and its residuals.

Run as `python docs/figures/calibrating.py`. The residuals are of a session on the simulated rig.
"""

import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from calibration.procedure import Residuals
from calibration.sessions.current import CurrentSession
from calibration.sessions.encoder import EncoderSession
from calibration.sessions.fsr import FsrSession
from calibration.sessions.ft import FtSession
from calibration.sessions.gearbox import GearboxSession
from calibration.sessions.torque import TorqueSession
from rig.calibrate.raw import read_raw
from rig.cli.main import main

OUT = Path(__file__).parent
WIDTH, HEIGHT, LEFT = 860, 240, 400
POINTS = 60
"""Marks of each run."""
COLOURS = ("#3b7dd8", "#d9822b", "#2e9e6b", "#b04fc4", "#888888", "#c44f6b", "#4fa7c4", "#7a6a3b")

DRIVE = "box 10 90 60 motor,box 80 90 60 gear,box 150 90 70 torque~sensor,box 230 90 70 cable"
LOAD = "box 310 90 70 load~motor,line 70 115 80 115,line 140 115 150 115,line 220 115 230 115"
SET_UPS = {
    "torque": "box 20 50 90 sensor~held fast,line 110 75 290 75,line 290 75 290 130,"
    "box 265 130 50 weight,text 130 65 arm 100 mm level,text 20 210 up and down again",
    "current": f"{DRIVE},{LOAD},line 300 115 310 115,text 10 60 drive turns back and forth,"
    "text 230 175 holds 0.1 to 0.9 A,text 10 175 current against torque",
    "gearbox": f"{DRIVE},{LOAD},line 300 115 310 115,text 10 60 encoder,text 150 60 encoder,"
    "line 30 65 30 90,line 170 65 170 90,text 10 175 twist of the gear over torque~both signs",
    "encoder": "circle 110 110 60,line 110 40 110 70,line 110 110 110 52,text 120 45 index mark,"
    "text 20 195 mark lined up by hand 5 times,circle 290 110 40,text 255 175 next encoder,"
    "line 170 110 250 110",
    "ft": "box 60 40 90 sensor,box 80 90 50 tool,line 105 140 105 190,line 105 190 98 178,"
    "line 105 190 112 178,text 115 185 weight,text 200 75 eight poses~nothing touches it",
    "fsr": "line 180 20 180 60,line 180 60 172 48,line 180 60 188 48,text 195 40 finger or weight,"
    "box 150 62 60 pad,box 130 112 100 resistor,box 110 162 140 force sensor",
}
"""Marks of each drawing: what, its place, and its words; `~` begins a new line."""

SESSIONS = {
    "torque": TorqueSession(),
    "current": CurrentSession(),
    "gearbox": GearboxSession(),
    "encoder": EncoderSession(),
    "ft": FtSession(),
    "fsr": FsrSession(),
}


def residuals(kind: str) -> Residuals:
    """Calibrate on the simulated rig, and return the residuals of the fit."""
    with tempfile.TemporaryDirectory() as place:
        raw = Path(place) / "raw"
        words = ["calibrate", kind, "--sim", "--yes", "--operator", "figure", "--seed", "1"]
        if code := main([*words, "--out", str(raw), "--store", f"{place}/store"]):
            raise SystemExit(code)
        _, measured, lines = read_raw(raw)
    return SESSIONS[kind].conclude(measured, lines).residuals


def set_up(marks: str) -> list[str]:
    """Return the drawing of a set-up as elements."""
    parts = []
    for mark in marks.split(","):
        what, *words = mark.split(" ")
        count = {"line": 4, "box": 3, "circle": 3, "text": 2}[what]
        at = [float(word) for word in words[:count]]
        lines = " ".join(words[count:]).split("~")
        if what == "line":
            x1, y1, x2, y2 = at
            parts.append(f'<path d="M{x1:g} {y1:g}L{x2:g} {y2:g}" stroke="black"/>')
            continue
        x, y = at[:2]
        if what == "circle":
            parts.append(
                f'<circle cx="{x:g}" cy="{y:g}" r="{at[2]:g}" fill="#eef" stroke="black"/>'
            )
            continue
        if what == "box":
            parts.append(
                f'<rect x="{x:g}" y="{y:g}" width="{at[2]:g}" height="50" fill="#eef"'
                ' stroke="black"/>'
            )
            x, y = x + 6, y + 20
        for k, line in enumerate(lines):
            parts.append(f'<text x="{x:g}" y="{y + 17 * k:g}">{line}</text>')
    return parts


def plot(found: Residuals) -> list[str]:
    """Return the residuals over their variable as elements, a colour a run."""
    thin = {
        name: tuple(values[:: max(1, len(values) // POINTS)] for values in pair)
        for name, pair in found.series.items()
    }
    x_low, x_high = _range([x for x, _ in thin.values()])
    y_low, y_high = _range([y for _, y in thin.values()])
    left, top, right, low = LEFT + 70, 20, WIDTH - 20, HEIGHT - 50
    parts = [
        f'<path d="M{left} {top}V{low}H{right}" fill="none" stroke="black"/>',
        f'<text x="{(left + right) / 2:g}" y="{HEIGHT - 12}" text-anchor="middle">'
        f"{found.label}</text>",
        f'<text transform="translate({left - 50} {(top + low) / 2:g}) rotate(-90)"'
        f' text-anchor="middle">{found.unit}</text>',
    ]
    for value, y in ((y_high, top + 5), (y_low, low)):
        parts.append(f'<text x="{left - 5}" y="{y}" text-anchor="end">{value:.3g}</text>')
    for value, x in ((x_low, left), (x_high, right)):
        parts.append(f'<text x="{x}" y="{low + 17}" text-anchor="middle">{value:.3g}</text>')
    for k, (x, y) in enumerate(thin.values()):
        across = left + 4 + (x - x_low) / (x_high - x_low) * (right - left - 8)
        up = low - 4 - (y - y_low) / (y_high - y_low) * (low - top - 8)
        dots = "".join(f"M{a:.0f} {b:.0f}h0" for a, b in zip(across, up, strict=True))
        colour = COLOURS[k % len(COLOURS)]
        parts.append(
            f'<path d="{dots}" stroke="{colour}" stroke-width="4" stroke-linecap="round"/>'
        )
    return parts


def _range(series: Sequence[np.ndarray]) -> tuple[float, float]:
    whole = np.concatenate(series)
    return float(whole.min()), float(whole.max())


def drawing(kind: str) -> str:
    """Return set-up and residuals of a calibration as SVG."""
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}"'
        ' font-family="sans-serif" font-size="13">'
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>'
    )
    return "\n".join([head, *set_up(SET_UPS[kind]), *plot(residuals(kind)), "</svg>", ""])


if __name__ == "__main__":
    for one in SESSIONS:
        (OUT / f"calibration-{one}.svg").write_text(drawing(one))
