"""Draw `docs/figures/machines.svg`: the parts of shipped machines, from their files.

python docs/figures/machines.py
"""

from pathlib import Path

from estimation.plant import Plant
from rig.machines.shipped import read_machine

OUT = Path(__file__).with_suffix(".svg")
NAMES = ("emps", "reference")
WIDTH, STEP, TALL, SPAN = 600, 200, 185, 160
"""Width of the drawing, of an axis with its transmission, height of a machine, width of a box."""


def machine(plant: Plant, top: float) -> list[str]:
    """Return a machine's axes in a row, sensors above and actuators below, as elements."""
    parts = [f'<text x="10" y="{top + 18:g}" font-weight="bold">{plant.name}</text>']
    middle = top + 80
    places = {axis.name: 10 + STEP * k for k, axis in enumerate(plant.axes)}
    for axis in plant.axes:
        x = places[axis.name]
        parts += [_box(x, middle, "#eef"), _text(x, middle + 22, f"{axis.name}, {axis.unit}")]
        reads = [sensor.name for sensor in plant.sensors if sensor.axis == axis.name]
        parts += [_text(x, middle - 10 - 17 * k, name, "#2e6e4b") for k, name in enumerate(reads)]
        drives = [one.name for one in plant.actuators if one.axis == axis.name]
        parts += [_text(x, middle + 55 + 17 * k, name, "#a04010") for k, name in enumerate(drives)]
    for one in plant.transmissions:
        at = places[one.input] + SPAN
        parts.append(f'<path d="M{at} {middle + 17}H{places[one.output]}" stroke="black"/>')
        ratio = "" if one.ratio is None else f", {one.ratio:g}"
        parts.append(_text(at - 40, middle + 90, f"{one.name}{ratio}", "#555"))
        parts.append(f'<path d="M{at + 20} {middle + 19}V{middle + 76}" stroke="#aaa"/>')
    return parts


def _box(x: float, y: float, fill: str) -> str:
    return f'<rect x="{x}" y="{y}" width="{SPAN}" height="34" fill="{fill}" stroke="black"/>'


def _text(x: float, y: float, words: str, colour: str = "black") -> str:
    return f'<text x="{x + 6}" y="{y}" fill="{colour}">{words}</text>'


def drawing() -> str:
    """Return the drawing as SVG."""
    tall = TALL * len(NAMES)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {tall}"'
        ' font-family="sans-serif" font-size="13">',
        f'<rect width="{WIDTH}" height="{tall}" fill="white"/>',
    ]
    for k, name in enumerate(NAMES):
        parts += machine(read_machine(Path(name)), TALL * k)
    return "\n".join([*parts, "</svg>", ""])


if __name__ == "__main__":
    OUT.write_text(drawing())
