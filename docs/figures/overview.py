"""Draw the overview figure of the README: `python docs/figures/overview.py`."""

from pathlib import Path

from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch

INK = "#1f2933"
STEEL = "#d9e2ec"
TRUTH = "#fde8c8"
SOFT = "#cfe8e3"

BOXES = [
    # text, x, y, width, colour
    ("drive motor\ncurrent, encoder", 0.0, 2.0, 1.9, STEEL),
    ("gearhead 35:1\ntwist", 2.3, 2.0, 1.7, STEEL),
    ("spindle\ntorque sensor, encoder", 4.4, 2.0, 2.3, TRUTH),
    ("cable, wrist\nfriction, stretch", 7.1, 2.0, 1.9, STEEL),
    ("jaw\ntorque sensor, encoder", 9.4, 2.0, 2.3, TRUTH),
    ("logger, 1 kHz\nsimulated or real", 0.0, 0.0, 1.9, SOFT),
    ("recording\nSI, flags, zeros", 2.3, 0.0, 1.7, SOFT),
    ("model\nnamed effects", 4.4, 0.0, 2.3, SOFT),
    ("residual\nwhat is left, and where", 7.1, 0.0, 1.9, SOFT),
    ("report on held-out\ntest runs", 9.4, 0.0, 2.3, SOFT),
]
ARROWS = [
    ((1.9, 2.5), (2.3, 2.5)),
    ((4.0, 2.5), (4.4, 2.5)),
    ((6.7, 2.5), (7.1, 2.5)),
    ((9.0, 2.5), (9.4, 2.5)),
    ((0.95, 2.0), (0.95, 1.0)),
    ((1.9, 0.5), (2.3, 0.5)),
    ((4.0, 0.5), (4.4, 0.5)),
    ((6.7, 0.5), (7.1, 0.5)),
    ((9.0, 0.5), (9.4, 0.5)),
]


def draw(path: Path) -> None:
    """Write the figure as SVG."""
    figure = Figure(figsize=(10, 3.2))
    axes = figure.add_axes((0.01, 0.02, 0.98, 0.96))
    axes.set_xlim(-0.1, 11.8)
    axes.set_ylim(-0.7, 3.4)
    axes.axis("off")
    for text, x, y, width, colour in BOXES:
        axes.add_patch(
            FancyBboxPatch(
                (x, y), width, 1.0, boxstyle="round,pad=0,rounding_size=0.12", fc=colour, ec=INK
            )
        )
        axes.text(x + width / 2, y + 0.5, text, ha="center", va="center", fontsize=9, color=INK)
    for start, stop in ARROWS:
        axes.add_patch(FancyArrowPatch(start, stop, arrowstyle="-|>", mutation_scale=12, color=INK))
    back = FancyArrowPatch(
        (8.05, 0.0),
        (5.55, 0.0),
        connectionstyle="arc3,rad=-0.35",
        arrowstyle="-|>",
        mutation_scale=12,
        color="#b44d12",
    )
    axes.add_patch(back)
    axes.text(6.8, -0.62, "the effect that was missing", ha="center", fontsize=9, color="#b44d12")
    axes.text(0.0, 3.15, "the rig", fontsize=10, weight="bold", color=INK)
    axes.text(2.3, 1.15, "the software", fontsize=10, weight="bold", color=INK)
    figure.savefig(path, metadata={"Date": None})


if __name__ == "__main__":
    draw(Path(__file__).with_suffix(".svg"))
