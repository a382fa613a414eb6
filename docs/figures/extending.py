"""Draw `docs/figures/extending.svg`: where an effect, an importer, a driver and a machine enter.

python docs/figures/extending.py
"""

from pathlib import Path

OUT = Path(__file__).with_suffix(".svg")
WIDTH, HEIGHT, BOX, TALL = 720, 250, 150, 40
"""Width and height of the drawing, and of a box."""

ADDED = (
    ("a driver", "rig.drivers", 0),
    ("an importer", "rig.importers", 1),
    ("an effect", "rig.effects", 2),
    ("a machine file", "--machine FILE", 1),
)
"""What is added, by which entry point or option, and the first stage that it serves."""

STAGES = ("record, live", "recordings", "fit, diagnose, estimate")


def drawing() -> str:
    """Return the drawing as SVG."""
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}"'
        ' font-family="sans-serif" font-size="13">',
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>',
    ]
    left = {k: 60 + 230 * k for k in range(len(STAGES))}
    for k, stage in enumerate(STAGES):
        parts += _box(left[k], 105, "#eef", stage, "")
        if k:
            parts.append(_arrow(left[k - 1] + BOX, 125, left[k], 125))
    for name, how, stage in ADDED:
        below = name == "a machine file"
        top = 195 if below else 15
        parts += _box(left[stage], top, "#efe", name, how)
        end, start = (145, top) if below else (105, top + TALL)
        parts.append(_arrow(left[stage] + BOX / 2, start, left[stage] + BOX / 2, end))
    return "\n".join([*parts, "</svg>", ""])


def _box(x: float, y: float, fill: str, name: str, how: str) -> list[str]:
    middle = x + BOX / 2
    return [
        f'<rect x="{x}" y="{y}" width="{BOX}" height="{TALL}" fill="{fill}" stroke="black"/>',
        f'<text x="{middle}" y="{y + (17 if how else 25)}" text-anchor="middle">{name}</text>',
        f'<text x="{middle}" y="{y + 33}" text-anchor="middle" fill="#555">{how}</text>',
    ]


def _arrow(x: float, y: float, to_x: float, to_y: float) -> str:
    along, down = (to_x > x) - (to_x < x), (to_y > y) - (to_y < y)
    head = (
        f"{to_x},{to_y} {to_x - 8 * along - 4 * down},{to_y - 8 * down - 4 * along}"
        f" {to_x - 8 * along + 4 * down},{to_y - 8 * down + 4 * along}"
    )
    return f'<path d="M{x} {y}L{to_x} {to_y}" stroke="black"/><polygon points="{head}"/>'


if __name__ == "__main__":
    OUT.write_text(drawing())
