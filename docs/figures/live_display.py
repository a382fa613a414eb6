"""Draw the live display as an SVG, `docs/figures/live.svg`, from a synthetic recording.

Run as `python docs/figures/live_display.py [TARGET]`. The recording is made here: a jaw that is
closed and opened against a load, a sensor with noise, and a motor current that carries friction the
shown estimate does not know.
"""

import dataclasses
import io
import re
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from estimation.recording import Recording
from rig.live.block import DeviceStatus, LimitStatus, SampleBlock
from rig.live.keys import OF_SESSION
from rig.live.options import ShowOptions, in_a_line
from rig.live.replay import replay_blocks
from rig.live.state import LiveState
from rig.live.view import View

TARGET = Path(__file__).with_name("live.svg")
TORQUE_PER_CURRENT_N_M_A = 0.42


class CurrentTimesConstant:
    """The simplest estimate: current times one constant, friction not known."""

    target_channel = "distal_torque_n_m"

    def push(
        self, columns: Mapping[str, NDArray[np.float64]], time_s: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the estimate, shape (n,), N m."""
        return columns["motor_current_a"] * TORQUE_PER_CURRENT_N_M_A


def synthetic_recording() -> Recording:
    """Return 12.2 s of grasps at 1 kHz."""
    rng = np.random.default_rng(7)
    time_s = np.arange(12_200) / 1000
    grasp = 0.5 - 0.5 * np.cos(2 * np.pi * 0.3 * time_s)
    torque_n_m = 0.125 * grasp**1.5
    friction_n_m = 0.012 * np.tanh(4 * np.gradient(grasp, time_s))
    current_a = (torque_n_m + friction_n_m) / TORQUE_PER_CURRENT_N_M_A
    return Recording(
        name="synthetic",
        time_s=time_s,
        columns={
            "motor_current_a": current_a + rng.normal(0, 0.003, time_s.size),
            "distal_torque_n_m": torque_n_m + rng.normal(0, 0.0005, time_s.size),
        },
    )


def with_devices(blocks: Iterator[SampleBlock]) -> Iterator[SampleBlock]:
    """Add what a session would know: devices and limits."""
    for block in blocks:
        yield dataclasses.replace(
            block,
            devices=(
                DeviceStatus("teensy", "armed", "simulated, SIM-0001"),
                DeviceStatus("load motor", "ok"),
                DeviceStatus("calibration", "ok", "reference+store, 3 records, oldest 12 days"),
                DeviceStatus(
                    "recording", "on", "live-2026-03-02-101500.mcap, 5200 samples, 1 marks"
                ),
            ),
            limits=(
                LimitStatus(
                    "motor_current_a", float(block.columns["motor_current_a"][-1]), 0.6, "A"
                ),
                LimitStatus(
                    "distal_torque_n_m", float(block.columns["distal_torque_n_m"][-1]), 0.3, "N m"
                ),
            ),
        )


def draw() -> str:
    """Return the display of the last moment as SVG."""
    recording, estimator = synthetic_recording(), CurrentTimesConstant()
    state = LiveState((estimator.target_channel,))
    for block in with_devices(replay_blocks(recording, [estimator], speed=None)):
        state.feed(block)
    console = Console(
        record=True, file=io.StringIO(), width=80, height=24, force_terminal=True,
        color_system="truecolor",
    )  # fmt: skip
    options = ShowOptions(
        title="rig live, synthetic recording",
        footer=in_a_line(OF_SESSION),
        half_widths=lambda: {estimator.target_channel: 0.014},
    )
    console.print(View(state.snapshot(), options))
    svg = console.export_svg(title="rig live", unique_id="live")
    # the fonts rich names are fetched from the network; any monospaced one will do
    return re.sub(r"\s*@font-face \{.*?\}", "", svg, flags=re.DOTALL)


if __name__ == "__main__":
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else TARGET
    part = target.with_suffix(".part")
    part.write_text(draw(), encoding="utf-8")
    part.replace(target)
    print(f"wrote {target}")
