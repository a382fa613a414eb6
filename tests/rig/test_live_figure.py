"""The figure of the display in the documentation is the display that there is."""

import html
import runpy
from pathlib import Path

FIGURES = Path(__file__).parents[2] / "docs/figures"


def words(svg):
    return html.unescape(svg).replace("\xa0", " ")


def test_figure_shows_what_the_display_shows_now():
    drawn = words(runpy.run_path(str(FIGURES / "live_display.py"))["draw"]())
    kept = words((FIGURES / "live.svg").read_text(encoding="utf-8"))
    for wanted in ("mN m", "at the jaw tip (lever 12 mm)", "lost 0", "1000 Hz", "teensy"):
        assert wanted in drawn
    texts = [part.split("</text>")[0] for part in drawn.split("<text")[1:]]
    stale = [t.split(">", 1)[1] for t in texts if t.split(">", 1)[1] not in kept]
    assert not stale, "run python docs/figures/live_display.py: the figure no longer matches"


def test_the_figure_of_the_grasper_can_be_drawn():
    drawn = words(runpy.run_path(str(FIGURES / "grasper_display.py"))["draw"]())
    assert "Grasp force, estimate" in drawn
    assert "? help" in drawn
