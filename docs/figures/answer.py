"""Take the picture of an answer, `docs/figures/answer.png`: the page of a diagnosis.

Run as `python docs/figures/answer.py DATA [EQUATION] [TARGET]`. Without DATA, `$RIG_DATA` is
searched for the first instrument of the reference rig. Needs Chromium and Playwright. Without data
or browser the present picture stays, and a line says so.
"""

import importlib.util
import os
import shutil
import sys
import tempfile
from pathlib import Path

from rig.cli.main import main

TARGET = Path(__file__).with_name("answer.png")
EQUATION = "gearbox"
PATTERN = "mrdlab-Tool_4_Maryland_L_2*"
SIZE = {"width": 900, "height": 1440}


def take(page: Path, target: Path) -> None:
    """Take a picture of the head of a page."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as running:
        browser = running.chromium.launch(
            executable_path=shutil.which("chromium"), args=["--no-sandbox", "--disable-gpu"]
        )
        shown = browser.new_page(viewport=SIZE, color_scheme="light")
        shown.goto(page.as_uri())
        shown.wait_for_selector("html[data-drawn=yes]")
        shown.screenshot(path=target)
        browser.close()


def data() -> Path | None:
    """Return the recordings to diagnose, None where there are none."""
    if len(sys.argv) > 1:
        return Path(sys.argv[1])
    folder = os.environ.get("RIG_DATA")
    return next(iter(sorted(Path(folder).glob(PATTERN))), None) if folder else None


def run() -> int:
    """Diagnose the data and take the picture; returns the exit code."""
    recordings = data()
    if recordings is None or shutil.which("chromium") is None:
        print("answer.png stays: no measured data (DATA or RIG_DATA), or no chromium")
        return 0
    if importlib.util.find_spec("playwright") is None:
        print("answer.png stays: no playwright")
        return 0
    equation = sys.argv[2] if len(sys.argv) > 2 else EQUATION
    target = Path(sys.argv[3]) if len(sys.argv) > 3 else TARGET
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        words = ["diagnose", str(recordings), "--equation", equation, "--quick"]
        words += ["--report", place, "--ledger", str(folder / "log.jsonl")]
        code = main(words)
        if code == 0:
            take(folder / "diagnosis.html", target)
        return code


if __name__ == "__main__":
    sys.exit(run())
