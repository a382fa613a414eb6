"""What recipes draw: an effect, what it is called, and the ranges its form is made for."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.rigs import kernel
from benchmarks.rigs.hidden import Hidden, Table
from benchmarks.rigs.plant import Plant
from benchmarks.rigs.sensors import Fault
from estimation.recording import FloatArray
from rig.simulation.forms import POINTS, Random, grid

TICK_S = 1e-3
MARGIN = 0.15
"""How far a table reaches beyond the usual range of its variable, shares of it."""


@dataclass(frozen=True, eq=False)
class Drawn:
    """One drawn effect.

    Attributes:
        place: Part of the machine, in words.
        family: What a diagnosis should call it; `unknown` outside the catalogue.
        variables: What it depends on, as a diagnosis calls it.
        part: The effect in the plant, or the fault of a sensor.
        guess: Amplitude that a first trial takes, in the unit of its place.
        synonyms: Families that name the same physics by another model of it.
    """

    place: str
    family: str
    variables: tuple[str, ...]
    part: Hidden | Fault
    guess: float
    synonyms: tuple[str, ...] = ()


@dataclass(frozen=True)
class Ranges:
    """Where the plant goes without effects: what tables are laid out over.

    Attributes:
        low: Variable to its half percent quantile.
        high: Variable to its 99.5 % quantile.
        usual: Variable to the median of its size, without sign.
        duration_s: Of a run.
        span_s: Of the campaign.
        plant: The rig.
    """

    low: Mapping[str, float]
    high: Mapping[str, float]
    usual: Mapping[str, float]
    duration_s: float
    span_s: float
    plant: Plant

    def level(self, place: str) -> float:
        """Return a tenth of the torque at a place."""
        torque = 0.1 * self.plant.pull * self.plant.load_scale
        return torque / self.plant.ratio if place == "motor" else torque

    def size(self, variable: str) -> float:
        """Return the largest usual size of a variable, without sign."""
        return max(abs(self.low[variable]), abs(self.high[variable]))

    def span(self, variable: str) -> float:
        """Return how far a variable ranges."""
        return self.high[variable] - self.low[variable]

    def table(self, variable: str, form: FloatArray | None = None) -> Table:
        """Lay a form, shape (`POINTS`,) on the unit grid, over a variable's range."""
        margin = MARGIN * self.span(variable)
        low, high = self.low[variable] - margin, self.high[variable] + margin
        if variable in ("run_time", "campaign_time", "dwell", "heat", "jump"):
            low, high = self.low[variable], self.high[variable]
        return Table(variable, low, high, grid() if form is None else form)

    def sided(self, variable: str, form: Callable[[FloatArray], FloatArray], odd: bool) -> Table:
        """Lay a form of a variable's size, 0 to about 1, over both signs, odd or even."""
        size = (1.0 + MARGIN) * self.size(variable)
        x = np.linspace(-1.0, 1.0, 2 * POINTS - 1)
        values = form(np.abs(x)) * (np.sign(x) if odd else 1.0)
        return Table(variable, -size, size, values)

    def way(self, variable: str, form: FloatArray) -> Table:
        """Lay a form over the size of a speed, from 0."""
        return Table(variable, 0.0, (1.0 + MARGIN) * self.high[variable], form)


Recipe = Callable[[Random, Ranges], Drawn]


def ranges_of(plant: Plant, runs: Sequence[FloatArray], starts_s: Sequence[float]) -> Ranges:
    """Return where the plant went in runs without effects, columns as the compiled loop's."""
    whole = np.concatenate(runs)
    columns = {
        "motor_angle": whole[:, kernel.MOTOR_ANGLE],
        "spindle_angle": whole[:, kernel.SPINDLE_ANGLE],
        "jaw_angle": whole[:, kernel.JAW_ANGLE],
        "current": whole[:, kernel.CURRENT],
        "gear_torque": whole[:, kernel.PROXIMAL],
        "cable_torque": whole[:, kernel.DISTAL],
    }
    for name, key in (
        ("motor_speed", kernel.MOTOR_ANGLE),
        ("spindle_speed", kernel.SPINDLE_ANGLE),
        ("jaw_speed", kernel.JAW_ANGLE),
    ):
        columns[name] = np.concatenate([np.gradient(run[:, key], TICK_S) for run in runs])
    spindle = [np.gradient(run[:, kernel.SPINDLE_ANGLE], TICK_S) for run in runs]
    columns["acceleration"] = np.concatenate([np.gradient(_smooth(v), TICK_S) for v in spindle])
    columns["twist"] = columns["gear_torque"] / plant.gear_stiffness
    columns["stretch"] = columns["cable_torque"] / plant.cable_stiffness
    columns["motor_way"] = np.abs(columns["motor_speed"])
    columns["spindle_way"] = np.abs(columns["spindle_speed"])
    duration = max(len(run) for run in runs) * TICK_S
    span = starts_s[-1] + duration
    fixed = {
        "run_time": (0.0, duration),
        "campaign_time": (0.0, span),
        "dwell": (0.0, 1.0),
        "heat": (0.0, max(float(np.mean(run[:, kernel.CURRENT] ** 2)) for run in runs)),
        "jump": (0.0, 1.0),
    }
    low = {name: float(np.percentile(x[::7], 0.5)) for name, x in columns.items()}
    high = {name: float(np.percentile(x[::7], 99.5)) for name, x in columns.items()}
    usual = {name: float(np.median(np.abs(x[::7]))) for name, x in columns.items()}
    low |= {name: ends[0] for name, ends in fixed.items()}
    high |= {name: ends[1] for name, ends in fixed.items()}
    return Ranges(low, high, usual, duration, span, plant)


def _smooth(values: FloatArray) -> FloatArray:
    return np.convolve(values, np.full(9, 1 / 9), "same")


def order_over(random: Random, ranges: Ranges, shaft: str, most: int) -> int:
    """Return a whole order of a shaft that passes a filter of 50 Hz and that the travel shows."""
    angle, speed = f"{shaft}_angle", f"{shaft}_speed"
    highest = 22.0 * 2.0 * np.pi / max(ranges.usual[speed], 1e-6)
    lowest = 2.0 * 2.0 * np.pi / ranges.span(angle)
    low = max(1, int(np.ceil(lowest)))
    high = max(low, min(most, int(highest)))
    return int(random.integers(low, high + 1))
