"""The simulated rig compared with a measured run of the same trajectory and load.

python -m benchmarks.measured_run --data Tool_4_Maryland_L_4.tar.xz --run 24
"""

import argparse
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from estimation.recording import Recording
from rig.errors import DataError
from rig.importers.registry import open_campaign
from rig.simulation.bench import SimulatedBench
from rig.simulation.play import play
from rig.simulation.sensors import spindle_count_of

FloatArray = NDArray[np.float64]

SETTLED = slice(1000, None)
"""The first second is left out: the load step at the start is not a grasp."""


@dataclass(frozen=True, slots=True)
class Level:
    """What one channel does in a run.

    Attributes:
        low: 5th percentile.
        middle: Median.
        high: 95th percentile.
    """

    low: float
    middle: float
    high: float

    @property
    def span(self) -> float:
        """From low to high."""
        return self.high - self.low


@dataclass(frozen=True, slots=True)
class Row:
    """One channel, measured and simulated."""

    channel: str
    measured: Level
    simulated: Level


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


def channels_of(columns: Mapping[str, FloatArray], gear_ratio: float) -> dict[str, FloatArray]:
    """Return the channels of the table; the zero of the gear's twist is free: its median."""
    twist = columns["motor_angle_rad"] / gear_ratio - columns["spindle_angle_rad"]
    made = {
        "gear_twist_rad": twist - np.median(twist),
        "tracking_error_rad": columns["target_angle_rad"] - columns["spindle_angle_rad"],
    }
    return {name: made[name] if name in made else columns[name] for name in CHANNELS}


def simulate_like(
    recording: Recording, bench: SimulatedBench | None = None
) -> dict[str, FloatArray]:
    """Simulate a measured run: its own trajectory, load and start.

    Args:
        recording: A run with the channels of the reference rig.
        bench: Bench to run on; the default parameters at the run's start when None.

    Returns:
        SI channels of the simulation, each of the run's length.

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
    start_rad = float(recording["spindle_angle_rad"][0])
    if bench is None:
        bench = SimulatedBench()
        bench = SimulatedBench(start_count=spindle_count_of(start_rad, bench.sensors))
    return play(bench, target_rad, recording["load_command_a"])


def compare(recording: Recording) -> list[Row]:
    """Return the levels of a measured run and of its simulation.

    Raises:
        DataError: The run has no trajectory to follow.
    """
    ratio = SimulatedBench().parameters.gear_ratio
    measured = channels_of(recording.columns, ratio)
    simulated = channels_of(simulate_like(recording), ratio)
    return [Row(name, _level(measured[name]), _level(simulated[name])) for name in CHANNELS]


def _level(values: FloatArray) -> Level:
    low, middle, high = np.percentile(values[SETTLED], [5.0, 50.0, 95.0])
    return Level(float(low), float(middle), float(high))


def main() -> None:
    """Print the levels of a measured run and of its simulation."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.measured_run", description=__doc__)
    parser.add_argument("--data", type=Path, required=True, help="Recordings of the reference rig.")
    parser.add_argument("--run", default="24", help="Name of the run.")
    asked = parser.parse_args()
    (run,) = open_campaign(asked.data).select([asked.run]).runs
    sys.stdout.write(
        f"{'channel':24s}{'measured 5 / 50 / 95 %':>30s}{'simulated 5 / 50 / 95 %':>30s}\n"
    )
    for row in compare(run.recording()):
        levels = [
            f"{s.low:9.4f} {s.middle:9.4f} {s.high:9.4f}" for s in (row.measured, row.simulated)
        ]
        sys.stdout.write(f"{row.channel:24s}{levels[0]:>30s}{levels[1]:>30s}\n")


if __name__ == "__main__":
    main()
