"""The filtered channels of one run, and the samples of it that equations count.

Every channel goes through the zero-phase filter of the equations' models and is kept at a few times
its cutoff. Effects with memory are worked out on that series; everything is regressed on a coarser
grid that all equations of a run share.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from estimation.derived import (
    CAMPAIGN_TIME,
    CLOCKS,
    MOTION,
    measured_channels,
    rates_of,
    zero_phase_channels,
)
from estimation.errors import EstimationError
from estimation.filters import LowPass
from estimation.model import Model, balance_channels
from estimation.noise import white_noise
from estimation.recording import FloatArray, Recording
from estimation.rest import in_motion

SERIES_PER_CUTOFF = 5.0
"""Samples kept for each period of the filter's cutoff, for effects with memory."""

GRID_PER_CUTOFF = 1.7
"""Samples regressed on for each period of the cutoff: neighbours nearer than that are alike."""

COULOMB = "friction.coulomb"
LEAST = 20
"""Samples that an equation needs of each run."""

ANGLES = tuple(MOTION)
EFFORTS = ("_n_m", "_n")
SENSORS = ("proximal_torque_n_m", "distal_torque_n_m")
"""Torque sensors of the reference rig: a motor without them is one of another machine."""


class LayoutError(EstimationError):
    """The runs do not hold what the declared equations need."""


@dataclass(frozen=True)
class RunSignals:
    """The filtered channels of one run.

    Attributes:
        name: Name of the run.
        channels: Channel to values, each of shape (n,), SI units; further signals may be added.
        rate_hz: Rate of these values.
        step: They are every so many samples of the recording.
        noise: Channel to one realisation of its sensors' white noise, filtered in the same way.
        grid: Places regressed on, indices into n.
        used: Equation to the samples it counts, indices into `grid`.
    """

    name: str
    channels: dict[str, FloatArray]
    noise: Mapping[str, FloatArray]
    rate_hz: float
    step: int
    low_pass: LowPass
    grid: NDArray[np.intp]
    used: Mapping[str, NDArray[np.intp]]

    def shaken(self) -> "RunSignals":
        """Return the run with a second realisation of its readings' noise, without instruments."""
        return replace(
            self, channels={n: x + self.noise.get(n, 0.0) for n, x in self.channels.items()}
        )

    @cached_property
    def memo(self) -> dict[object, FloatArray | None]:
        """Columns already worked out."""
        return {}

    def on_grid(self, channel: str) -> FloatArray:
        """Return a channel at the places regressed on, shape (len(grid),)."""
        return self.once(("grid", channel), lambda: self.channels[channel][self.grid])

    def once(self, key: object, make: Callable[[], FloatArray]) -> FloatArray:
        """Return the array that was worked out under a key, or work it out now."""
        found = self.memo.get(key)
        if found is None:
            found = self.memo[key] = make()
        return found


def signals_of_run(
    recording: Recording, of_equation: Mapping[str, Model], measured: Sequence[str]
) -> RunSignals:
    """Return the signals of a run that equations need, of their models, and every measured channel.

    Raises:
        LayoutError: Some equation has too few samples of this run.
        FilterError: The run cannot be filtered.
    """
    models = [*of_equation.values()]
    low_pass, signals = models[0].low_pass, models[0].signals
    joined = [c.name for c in signals.joined if c.shares[0].channel in measured]
    positions = [*measured, *(n for n in joined if signals.combination(n) is not None)]
    moved = [rate for position in positions for rate in rates_of(position)]
    wanted = [*positions, *moved, *(n for m in models for n in (*m.channels, m.target))]
    filtered = zero_phase_channels(recording, [*wanted, CAMPAIGN_TIME], low_pass, signals)
    valid, step, grid = _places(filtered, low_pass)
    channels = {name: np.array(filtered[name])[::step] for name in dict.fromkeys(wanted)}
    reading = measured_channels((n for n in wanted if n != CAMPAIGN_TIME), signals)
    random = zero_phase_channels(
        white_noise(recording, reading, signals), wanted, low_pass, signals
    )
    noise = {n: np.array(random[n])[::step] for n in dict.fromkeys(wanted) if n not in CLOCKS}
    channels[CAMPAIGN_TIME] = np.array(recording[CAMPAIGN_TIME])[::step]
    stated = [n for n in recording.conditions if n in recording and n not in channels]
    channels.update({name: recording[name][::step] for name in stated})
    channels["time_s"] = (recording.time_s - recording.time_s[0])[::step]
    rate_hz = recording.sample_rate_hz / step
    used = {}
    for equation, model in of_equation.items():
        used[equation] = _used(model, channels, valid, rate_hz, grid)
        if len(used[equation]) < LEAST:
            raise LayoutError(
                f"Run {recording.name!r} has {len(used[equation])} samples for the equation"
                f" {equation}.",
                "The others are flagged, at rest, or too near to the ends for the filter.",
                "Record it again, or exclude it.",
            )
    return RunSignals(recording.name, channels, noise, rate_hz, step, low_pass, grid, used)


def samples_in_motion(model: Model, recording: Recording) -> int:
    """Return the number of samples of a run that an equation is regressed on.

    Raises:
        MissingChannelError: The run lacks a channel of the equation.
    """
    filtered = balance_channels(model, recording)
    valid, step, grid = _places(filtered, model.low_pass)
    channels = {name: values[::step] for name, values in filtered.columns.items()}
    return len(_used(model, channels, valid, recording.sample_rate_hz / step, grid))


def _places(
    filtered: Recording, low_pass: LowPass
) -> tuple[NDArray[np.bool_], int, NDArray[np.intp]]:
    """Return which samples of the series are sound, its step, and the places regressed on."""
    rate_hz = filtered.sample_rate_hz
    step = max(1, int(rate_hz / (SERIES_PER_CUTOFF * low_pass.cutoff_hz)))
    edge = int(np.ceil(2 * low_pass.reach_s * rate_hz))
    spoilt = ndimage.maximum_filter1d((~filtered.valid).astype(np.uint8), 2 * edge + 1) > 0
    spoilt[:edge] = True
    spoilt[max(len(spoilt) - edge, 0) :] = True
    valid = ~spoilt[::step]
    coarse = max(1, round(rate_hz / step / (GRID_PER_CUTOFF * low_pass.cutoff_hz)))
    grid = np.arange(0, len(valid), coarse)
    return valid, step, grid[valid[grid]]


def _used(
    model: Model,
    channels: Mapping[str, FloatArray],
    valid: NDArray[np.bool_],
    rate_hz: float,
    grid: NDArray[np.intp],
) -> NDArray[np.intp]:
    """Return the places of the grid that an equation counts: those in motion, with friction."""
    speed = next((t.channels["speed"] for t in model.terms if t.effect.id == COULOMB), "")
    if not speed or model.counted == "all":
        return np.arange(len(grid))
    moving = in_motion(channels[speed], valid, rate_hz, model.signals.rest.get(speed, 0.0))
    return np.flatnonzero(moving[grid])
