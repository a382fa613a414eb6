"""The simulated rig compared with a measured run of the same trajectory and load.

python -m benchmarks.measured_run --data Tool_4_Maryland_L_4.tar.xz --run 24
"""

import argparse
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from estimation.recording import FloatArray, Recording
from rig.errors import DataError
from rig.importers.registry import open_campaign
from rig.simulation.campaign import bench_at
from rig.simulation.parameters import PlantParameters

SETTLED = slice(1000, None)
"""The first second is left out: the load step at the start is not a grasp."""

CHANNELS = (
    "motor_current_a",
    "proximal_torque_n_m",
    "distal_torque_n_m",
    "spindle_angle_rad",
    "jaw_angle_rad",
    "gear_twist_rad",
    "tracking_error_rad",
)
"""Channels of the table; the last two are made here of a run's angles."""


class Level(NamedTuple):
    """What one channel does in a run: its 5th, 50th and 95th percentile."""

    low: float
    middle: float
    high: float

    @property
    def span(self) -> float:
        """From low to high."""
        return self.high - self.low


def levels(columns: Mapping[str, FloatArray]) -> dict[str, Level]:
    """Return the levels of a run's channels; the zero of the gear's twist is free: its median."""
    twist = columns["motor_angle_rad"] / PlantParameters().gear_ratio - columns["spindle_angle_rad"]
    made = {
        **columns,
        "gear_twist_rad": twist - np.median(twist),
        "tracking_error_rad": columns["target_angle_rad"] - columns["spindle_angle_rad"],
    }
    return {
        name: Level(*np.percentile(made[name][SETTLED], [5.0, 50.0, 95.0])) for name in CHANNELS
    }


def compare(recording: Recording) -> tuple[dict[str, Level], dict[str, Level]]:
    """Return the levels of a measured run and of a simulation of its trajectory, load and start.

    Raises:
        DataError: The run has no trajectory to follow.
    """
    target_rad = recording["target_angle_rad"]
    if not np.any(target_rad):
        raise DataError(
            f"Run {recording.name!r} has no trajectory: its target is zero throughout.",
            "Some folders of the data set were logged without it.",
            "Choose a run of Tool_4_Maryland_L_4.",
        )
    bench = bench_at(float(recording["spindle_angle_rad"][0]))
    simulated = bench.play(target_rad, recording["load_command_a"])
    return levels(recording.columns), levels(simulated)


def main() -> None:
    """Print the levels of a measured run and of its simulation."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.measured_run", description=__doc__)
    parser.add_argument("--data", type=Path, required=True, help="Recordings of the reference rig.")
    parser.add_argument("--run", default="24", help="Name of the run.")
    asked = parser.parse_args()
    (run,) = open_campaign(asked.data).select([asked.run]).runs
    measured, simulated = compare(run.recording())
    heads = ("measured 5 / 50 / 95 %", "simulated 5 / 50 / 95 %")
    sys.stdout.write(f"{'channel':24s}{heads[0]:>30s}{heads[1]:>30s}\n")
    for name in CHANNELS:
        cells = [
            f"{one.low:9.4f} {one.middle:9.4f} {one.high:9.4f}"
            for one in (measured[name], simulated[name])
        ]
        sys.stdout.write(f"{name:24s}{cells[0]:>30s}{cells[1]:>30s}\n")


if __name__ == "__main__":
    main()
