"""Hold the simulated rig against a measured run of the same trajectory and load.

python -m rig.simulation.compare --data Tool_4_Maryland_L_4.tar.xz --run 24
"""

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from numpy.typing import NDArray

from estimation.recording import Recording
from rig.cli.output import JsonFlag, emit_json, results
from rig.errors import DataError, UsageError
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


def draw_figure(recording: Recording, path: Path) -> None:
    """Write a figure of both runs, channel by channel over time; the file is replaced at once."""
    from matplotlib.figure import Figure

    ratio = SimulatedBench().parameters.gear_ratio
    measured = channels_of(recording.columns, ratio)
    simulated = channels_of(simulate_like(recording), ratio)
    time_s = recording.time_s - recording.time_s[0]
    figure = Figure(figsize=(10.0, 2.2 * len(CHANNELS)), layout="constrained")
    for axis, name in zip(figure.subplots(len(CHANNELS), 1, sharex=True), CHANNELS, strict=True):
        axis.plot(time_s, measured[name], label="measured", linewidth=0.8)
        axis.plot(time_s, simulated[name], label="simulated", linewidth=0.8)
        axis.set_ylabel(name)
    figure.axes[0].legend(loc="upper right")
    figure.axes[-1].set_xlabel("time_s")
    beside = path.with_name(f".{path.name}.part")
    with beside.open("wb") as file:
        figure.savefig(file, format="png")
    beside.replace(path)


def main(
    data: Annotated[Path, typer.Option(help="Folder, file or archive of the reference rig.")],
    run: Annotated[str, typer.Option(help="Name of the run.")] = "24",
    figure: Annotated[Path | None, typer.Option(help="Also write a figure here (PNG).")] = None,
    as_json: JsonFlag = False,
) -> None:
    """Print the levels of a measured run and of its simulation."""
    from rig.importers.registry import open_campaign

    chosen = [handle for handle in open_campaign(data).runs if handle.name == run]
    if not chosen:
        raise UsageError(f"{data} has no run {run!r}.", fix="Name a run of that campaign.")
    recording = chosen[0].recording()
    rows = compare(recording)
    if figure is not None:
        draw_figure(recording, figure)
    if as_json:
        emit_json({"run": recording.name, "rows": rows, "figure": figure})
        return
    out = results(json=False)
    out.print(f"{'channel':24s}{'measured 5 / 50 / 95 %':>30s}{'simulated 5 / 50 / 95 %':>30s}")
    for row in rows:
        levels = [
            f"{s.low:9.4f} {s.middle:9.4f} {s.high:9.4f}" for s in (row.measured, row.simulated)
        ]
        out.print(f"{row.channel:24s}{levels[0]:>30s}{levels[1]:>30s}")


if __name__ == "__main__":
    from rig.cli.main import app
    from rig.cli.main import main as command_line

    # as a verb of `rig`, for its errors and exit codes
    app.command("compare")(main)
    sys.exit(command_line(["compare", *sys.argv[1:]]))
