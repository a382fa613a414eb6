"""Take the picture of the live page, `docs/figures/live-web.png`, from the simulated rig.

Run as `python docs/figures/live_web.py [TARGET]`; it needs Playwright and the system's Chromium.
"""

import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path

from playwright.sync_api import sync_playwright

TARGET = Path(__file__).with_name("live-web.png")
COMMAND = ["live", "--sim", "--plain", "--web", "--web-port", "0"]
SHOWN_S = 15


def main(target: Path = TARGET) -> None:
    """Run the command, open its page, and write the picture of it after 15 s of device time."""
    with subprocess.Popen(  # noqa: S603
        [sys.executable, "-m", "rig", *COMMAND],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    ) as live:
        lines = iter(live.stderr.readline, "") if live.stderr else iter(())
        url = next(found[0] for line in lines if (found := re.search("http://.*", line)))
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(
                executable_path=shutil.which("chromium"), args=["--no-sandbox"]
            )
            page = browser.new_page(viewport={"width": 860, "height": 980})
            page.goto(url)
            newest_s = "parseFloat(document.getElementById('time').textContent)"
            page.wait_for_function(f"{newest_s} > {SHOWN_S}", timeout=120_000)
            page.screenshot(path=target)
            browser.close()
        live.send_signal(signal.SIGINT)


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
