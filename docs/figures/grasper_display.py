"""Draw the live display of the simulated 3-DOF grasper as an SVG, `docs/figures/grasper.svg`.

Run as `python docs/figures/grasper_display.py [TARGET]`.
"""

import io
import re
import sys
from pathlib import Path

from rich.console import Console

from estimation.files import write_text_atomic
from rig.live.grasper import CHANNELS, master_session
from rig.live.replay import replay_blocks
from rig.live.state import LiveState
from rig.live.view import View

TARGET = Path(__file__).with_name("grasper.svg")
SHOWN_S = 5.0


def draw() -> str:
    """Return the display while the grasp is held, as SVG."""
    state = LiveState(CHANNELS)
    for block in replay_blocks(master_session(), None, speed=None):
        state.feed(block)
        if block.time_s[-1] > SHOWN_S:
            break
    console = Console(
        record=True, file=io.StringIO(), width=80, height=24, force_terminal=True,
        color_system="truecolor",
    )  # fmt: skip
    console.print(View(state.snapshot(), "rig live: simulated 3-DOF grasper", lever_m=0.01))
    svg = console.export_svg(title="rig live --grasper", unique_id="grasper")
    # the fonts rich names are fetched from the network; any monospaced one will do
    return re.sub(r"\s*@font-face \{.*?\}", "", svg, flags=re.DOTALL)


if __name__ == "__main__":
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else TARGET
    write_text_atomic(target, draw())
    print(f"wrote {target}")
