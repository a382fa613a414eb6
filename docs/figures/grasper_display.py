"""Draw the live display of the simulated 3-DOF grasper as an SVG, `docs/figures/grasper.svg`.

Run as `python docs/figures/grasper_display.py [TARGET]`. It is `rig live -c grasper` while the
grasp is held.
"""

import io
import re
import sys
from contextlib import closing
from pathlib import Path

from rich.console import Console

from estimation.files import write_text_atomic
from rig.bench.logger import open_logger
from rig.configuration.config import SHIPPED, load_config
from rig.live.block import through
from rig.live.estimator import estimators_of, half_widths
from rig.live.joint_forces import JOINTS
from rig.live.keys import OF_SESSION
from rig.live.options import ShowOptions, in_a_line
from rig.live.session_blocks import session_blocks
from rig.live.state import LiveState
from rig.live.status import model_steps
from rig.live.view import View
from rig.machines.choose import machine_of
from rig.protocols.protocol import load_protocol

TARGET = Path(__file__).with_name("grasper.svg")
MODEL = SHIPPED / "simulated_grasper.model.toml"
HELD_N = 1.0


def draw() -> str:
    """Return the display while the grasp is held, as SVG."""
    config = load_config(Path("grasper"))
    rate_hz = machine_of(config).profile.rate_hz
    estimators = estimators_of(MODEL, rate_hz)
    plans = [plan for plan in load_protocol("grasper").any_plans() if "grasp-hold" in plan.name]
    session = session_blocks(config, lambda: open_logger(config), plans, estimators)
    blocks = through(session, model_steps(estimators))
    state = LiveState(JOINTS)
    held = 0
    with closing(blocks):
        for block in blocks:
            state.feed(block)
            held += bool(block.columns["grasp_force_n"].mean() > HELD_N)
            if held > 10:
                break
    console = Console(
        record=True, file=io.StringIO(), width=80, height=24, force_terminal=True,
        color_system="truecolor",
    )  # fmt: skip
    options = ShowOptions(
        title=f"rig live: {config.name}",
        lever_m=0.01,
        footer=in_a_line(OF_SESSION),
        half_widths=lambda: half_widths(estimators),
    )
    console.print(View(state.snapshot(), options))
    svg = console.export_svg(title="rig live -c grasper", unique_id="grasper")
    # the fonts rich names are fetched from the network; any monospaced one will do
    return re.sub(r"\s*@font-face \{.*?\}", "", svg, flags=re.DOTALL)


if __name__ == "__main__":
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else TARGET
    write_text_atomic(target, draw())
    print(f"wrote {target}")
