"""Draw what a diagnosis costs over samples and over effects, `docs/figures/diagnosis-cost.svg`.

Run as `python docs/figures/diagnosis_cost.py [TARGET]`. Both axes are ratios to the smallest.
"""

import io
import sys
from pathlib import Path

import matplotlib as mpl

sys.path.insert(0, str(Path(__file__).parents[2]))

from benchmarks.bench_diagnosis import Cost, costs_over_effects, costs_over_samples
from estimation.files import write_text_atomic

mpl.use("svg")
from matplotlib import pyplot as plt

TARGET = Path(__file__).with_name("diagnosis-cost.svg")


def draw() -> str:
    """Return the two plots as SVG."""
    mpl.rcParams["svg.hashsalt"] = "diagnosis-cost"
    figure, axes = plt.subplots(1, 2, figsize=(7.0, 3.2), sharey=True, layout="constrained")
    panels = [
        ("samples", costs_over_samples(), lambda one: one.samples),
        ("effects tried", costs_over_effects(), lambda one: one.candidates),
    ]
    for axis, (what, costs, size) in zip(axes, panels, strict=True):
        panel(axis, what, [size(one) / size(costs[0]) for one in costs], costs)
    axes[0].set_ylabel("cost, times the smallest")
    axes[0].legend(frameon=False)
    text = io.StringIO()
    figure.savefig(text, format="svg", metadata={"Date": None})
    plt.close(figure)
    return text.getvalue()


def panel(axis: plt.Axes, what: str, sizes: list[float], costs: list[Cost]) -> None:
    """Draw one plot: what was measured, and what in proportion would be."""
    axis.plot(sizes, sizes, "--", color="0.6", label="in proportion")
    axis.plot(sizes, [c.seconds / costs[0].seconds for c in costs], "o-", label="measured")
    axis.set_xlabel(f"{what}, times the smallest")
    axis.set_xlim(0.0)
    axis.set_ylim(0.0)


if __name__ == "__main__":
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else TARGET
    write_text_atomic(target, draw())
    print(f"wrote {target}")
