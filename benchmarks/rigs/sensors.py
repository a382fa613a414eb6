"""Sensor chains drawn over factors: counts, noise of several colours, zeros, lags, skewed clocks.

They read what the plant did; nothing of theirs reaches it, and no fault of theirs moves it. The
controller has its own encoder.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy import signal

from benchmarks.rigs.hidden import Table
from benchmarks.rigs.plant import Plant, over
from estimation.recording import FloatArray
from rig.simulation.forms import Random
from rig.simulation.plant import TICK_S

READINGS = (
    "motor_angle_rad",
    "spindle_angle_rad",
    "jaw_angle_rad",
    "motor_current_a",
    "proximal_torque_n_m",
    "distal_torque_n_m",
)
"""Channels that a sensor reads, in the order of the compiled loop's columns."""

DEVICE = (0, 1, 2, 0, 1, 2)
"""Which device's clock dates each reading: the drive's, the spindle's, the jaw's."""

FORERUN_S = 3.0
"""Coloured noise starts so long before the run, so that it is as wide at its start as later."""


@dataclass(frozen=True)
class Reading:
    """One sensor, SI units."""

    quantum: float  # Step of its converter
    white: float = 0.0  # Standard deviation of its white noise
    colour: float = 0.0  # Standard deviation of its coloured noise
    colour_s: float = 0.05  # Time within which that forgets
    walk: float = 0.0  # Random walk of its zero: standard deviation after 1 s
    offset: float = 0.0  # Zero of the campaign
    offset_width: float = 0.0  # Standard deviation of each run's own zero about that
    lag_s: float = 0.0  # First-order lag


@dataclass(frozen=True)
class Chain:
    """All sensors of a rig.

    Attributes:
        readings: One for each of `READINGS`.
        skew_s: How late each device's clock dates what it reads.
        rate: How much faster each device's clock runs, as a share.
    """

    readings: tuple[Reading, ...]
    skew_s: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rate: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def on_time(self) -> "Chain":
        """The same sensors without lags, with one clock."""
        return self.hastened(0.0)

    def hastened(self, share: float) -> "Chain":
        """Return the same sensors with their lags and skews multiplied by a share."""
        readings = tuple(replace(r, lag_s=share * r.lag_s) for r in self.readings)
        skew = tuple(share * x for x in self.skew_s)
        rate = tuple(share * x for x in self.rate)
        return Chain(readings, (skew[0], skew[1], skew[2]), (rate[0], rate[1], rate[2]))


def draw_chain(random: Random, plant: Plant) -> Chain:
    """Draw the sensors of a rig, to the torques and currents it is made for."""
    torque = plant.pull * plant.load_scale
    current = torque / plant.ratio / plant.constant
    turn = 2.0 * np.pi
    angles = [
        Reading(turn / over(random, 500.0 if k == 0 else 4e3, 1.6e4 if k == 0 else 1e5))
        for k in range(3)
    ]
    slow = float(random.uniform(0.0, 1.0)) < 0.6
    torques = [_electric(random, scale, slow) for scale in (torque, plant.load_scale)]
    skewed = random.random() < 0.5
    skew = random.uniform(-3e-4, 3e-4, 3) * skewed
    rate = random.uniform(-1e-5, 1e-5, 3) * skewed
    return Chain(
        (*angles, _electric(random, current, slow), *torques),
        (0.0, float(skew[1]), float(skew[2])),
        (0.0, float(rate[1]), float(rate[2])),
    )


def _electric(random: Random, scale: float, slow: bool) -> Reading:
    """Return an amplifier and its converter, for a quantity of some size."""
    white = scale * over(random, 5e-4, 1e-2)
    return Reading(
        quantum=scale / 2.0 ** random.uniform(8.0, 13.0),
        white=white,
        colour=white * float(random.uniform(0.0, 0.5)) * (random.random() < 0.6),
        colour_s=over(random, 5e-3, 0.4),
        walk=white * over(random, 0.01, 0.1) * slow,
        offset=scale * float(random.normal(0.0, 0.03)),
        offset_width=scale * over(random, 5e-4, 1e-2),
        lag_s=over(random, 5e-5, 8e-4) * (random.random() < 0.5),
    )


def read(
    chain: Chain,
    true: FloatArray,
    errors: Mapping[str, FloatArray],
    noise: Sequence[FloatArray] | None,
) -> dict[str, FloatArray]:
    """Return the readings of a run's sensors of what is true, shape (n, 6 or more).

    Faults add `errors` to readings. Without noise the converters have no steps.
    """
    t = np.arange(len(true)) * TICK_S
    found = {}
    for k, (name, reading) in enumerate(zip(READINGS, chain.readings, strict=True)):
        values = true[:, k] + errors.get(name, 0.0)
        late_s = chain.skew_s[DEVICE[k]] + chain.rate[DEVICE[k]] * t
        if np.any(late_s):
            values = np.interp(t - late_s, t, values)
        if reading.lag_s > 0.0:
            values = lagged(values, reading.lag_s)
        if noise is not None:
            values = values + noise[k]
            values = np.floor(values / reading.quantum + 0.5) * reading.quantum
        found[name] = values
    return found


def lagged(values: FloatArray, time_s: float) -> FloatArray:
    """Return values behind a first-order lag, settled at the start, shape (n,)."""
    keep = np.exp(-TICK_S / time_s)
    start = np.array([keep * values[0]])
    return np.asarray(signal.lfilter([1.0 - keep], [1.0, -keep], values, zi=start)[0])


def noise_of(chain: Chain, n: int, seed: Sequence[int]) -> tuple[FloatArray, ...]:
    """Return noise and zero of each sensor in one run, shape (n,) each."""
    random = np.random.default_rng(list(seed))
    return tuple(_noise(random, reading, n) for reading in chain.readings)


def _noise(random: Random, reading: Reading, n: int) -> FloatArray:
    """Return noise and zero of one run, shape (n,); draws the same numbers whatever its sizes."""
    before = round(FORERUN_S / TICK_S)
    white, fresh, steps = random.standard_normal((3, n + before))
    keep = np.exp(-TICK_S / reading.colour_s)
    colour = signal.lfilter([np.sqrt(1.0 - keep**2)], [1.0, -keep], fresh)[before:]
    walk = np.cumsum(steps[before:]) * np.sqrt(TICK_S)
    zero = reading.offset + reading.offset_width * random.standard_normal()
    noise: FloatArray = (
        zero + reading.white * white[before:] + reading.colour * colour + reading.walk * walk
    )
    return noise


@dataclass(frozen=True, eq=False)
class Fault:
    """One fault of one sensor.

    Attributes:
        reading: Channel of the sensor.
        kind: `function`: amplitude x table(source); `delay`: late by the amplitude, s; `lag`:
            behind a lag of the amplitude, s; `creep`: a share of the amplitude that comes slowly.
        source: Channel that the table is over, its own or another one, or `run_time` or
            `campaign_time`.
        table: Of a function.
        times_s: Of creep: its time constants.
        weights: Of creep: the share of each.
    """

    reading: str
    kind: str
    source: str = ""
    table: Table | None = None
    times_s: FloatArray = field(default_factory=lambda: np.empty(0))
    weights: FloatArray = field(default_factory=lambda: np.empty(0))


def error_of(
    fault: Fault, amplitude: float, true: Mapping[str, FloatArray], first: int, start_s: float
) -> FloatArray:
    """Return the values that a fault adds to its reading in one run, shape (n,).

    Args:
        fault: The fault.
        amplitude: Its size, in the reading's unit, s for delay and lag, 1 for creep.
        true: Channel to what there is, shape (n,), from the lead on.
        first: Sample at which the run begins.
        start_s: Campaign time of that sample.
    """
    own = true[fault.reading]
    t: FloatArray = (np.arange(len(own)) - first) / 1000.0
    if fault.kind == "delay":
        return np.asarray(np.interp(t - amplitude, t, own) - own)
    if fault.kind == "lag":
        return lagged(own, amplitude) - own
    if fault.kind == "creep":
        parts = zip(fault.weights, fault.times_s, strict=True)
        slow = sum(w * (lagged(own, float(time)) - own) for w, time in parts)
        return np.asarray(amplitude * slow)
    assert fault.table is not None
    clocks: dict[str, FloatArray] = {"run_time": t, "campaign_time": start_s + t}
    source: FloatArray = clocks[fault.source] if fault.source in clocks else true[fault.source]
    return amplitude * fault.table.at(source)
