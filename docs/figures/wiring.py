"""Draw `docs/figures/wiring.svg`: power, emergency stop and enable of a rig.

python docs/figures/wiring.py
"""

from pathlib import Path

OUT = Path(__file__).with_suffix(".svg")
WIDTH, HEIGHT = 860, 400
BOXES = {
    "supply": (20, 40, 120, 60, ["24 V supply"]),
    "stop": (180, 40, 140, 60, ["emergency stop", "contact 1 (NC)"]),
    "relay": (360, 40, 140, 60, ["relay", "motor supply"]),
    "escon": (560, 40, 150, 150, ["ESCON", "", "enable", "set value", "direction", "ready"]),
    "motor": (750, 40, 90, 60, ["motor"]),
    "board": (180, 230, 320, 150, ["Teensy"]),
    "contact": (20, 300, 120, 60, ["emergency stop", "contact 2 (NC)"]),
    "pump": (360, 140, 140, 50, ["monoflop 20 ms", "or charge pump"]),
}
WIRES = [
    ([(140, 70), (180, 70)], ""),
    ([(320, 70), (360, 70)], ""),
    ([(500, 70), (560, 70)], ""),
    ([(710, 70), (750, 70)], ""),
    ([(430, 140), (430, 100)], "holds the relay"),
    ([(430, 230), (430, 190)], "chip alive"),
    ([(500, 250), (600, 250), (600, 190)], "enable, direction, set value"),
    ([(690, 190), (690, 340), (500, 340)], "ready (low), current"),
    ([(140, 330), (180, 330)], "stop input"),
    ([(80, 360), (80, 385)], "ground"),
    ([(640, 190), (640, 225)], "10 kOhm from enable to ground"),
]
"""Corners of each wire, and what is written at its last one."""


def drawing() -> str:
    """Return the drawing as SVG."""
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}"'
        ' font-family="sans-serif" font-size="13">',
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>',
    ]
    for corners, label in WIRES:
        points = " ".join(f"{x},{y}" for x, y in corners)
        parts.append(f'<polyline points="{points}" fill="none" stroke="black"/>')
        (x0, y0), (x1, y1) = corners[-2:]
        at_x, at_y = (x0 + x1) / 2 + 6, (y0 + y1) / 2 + 4
        if y0 == y1:
            at_x, at_y = min(x0, x1) + 2, y0 - 6
        if label:
            parts.append(f'<text x="{at_x:g}" y="{at_y:g}" fill="#555">{label}</text>')
    for x, y, width, height, lines in BOXES.values():
        parts.append(
            f'<rect x="{x}" y="{y}" width="{width}" height="{height}" fill="#eef" stroke="black"/>'
        )
        for k, line in enumerate(lines):
            parts.append(f'<text x="{x + 8}" y="{y + 22 + 19 * k}">{line}</text>')
    return "\n".join([*parts, "</svg>", ""])


if __name__ == "__main__":
    OUT.write_text(drawing())
