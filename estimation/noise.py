"""White noise of sensors: as a machine's file states it, else as a recording shows it."""

import math
from collections.abc import Sequence

import numpy as np
from scipy.integrate import cumulative_trapezoid

from estimation.derived import measured_channels, origin_of
from estimation.recording import FloatArray, Recording
from estimation.signals import Reading, Signals

WHOLE = 0.05
"""Part of a count that changes may differ from whole counts by, in the middle of them."""

MOST_NOISE = 0.3
"""Share of a channel that may be noise of its reading: a term of it is too small by its square."""


MOST_ERROR = 0.7
"""Share of an equation's error that is one channel's noise: half of its square."""


def white_noise(recording: Recording, measured: Sequence[str], signals: Signals) -> Recording:
    """Return a recording of white noise, as wide in each measured channel as that channel's own.

    A sensor that is slower than the recording holds each value, and so its noise. A position that
    is the integral of a measured speed has the integral of that speed's noise.
    """
    random = np.random.default_rng(0)
    made = {}
    for name in measured:
        speed = signals.integrals.get(name, "")
        source = speed if speed in recording else name
        known = signals.readings.get(source, Reading())
        held = 1 if known.rate_hz is None else round(recording.sample_rate_hz / known.rate_hz)
        white = random.standard_normal(len(recording))
        at = np.arange(len(recording)) // max(held, 1)
        noise = noise_width(recording[source], known) * white[at]
        integral = source != name
        made[name] = cumulative_trapezoid(noise, recording.time_s, initial=0) if integral else noise
    return recording.with_columns(**made)


def noise_of(channel: str, signals: Signals) -> str:
    """Return in words whose noise that of a derivative is."""
    read = measured_channels([channel], signals)
    source = read[0] if len(read) == 1 else origin_of(channel)[0]
    return f"noise of {signals.integrals.get(source, source)} in {channel}"


def noisy_sentence(channel: str, share: float, remedy: str) -> str:
    """Return that a channel is mostly noise of its reading, and the remedy."""
    return (
        f"{share:.0%} of {channel} is noise of its reading, so its term comes out too small."
        f" {remedy}"
    )


def noise_width(values: FloatArray, known: Reading) -> float:
    """Return the standard deviation of a reading's white noise, the steps of its counts included.

    Unless stated: third differences hold noise and nearly no motion; a tenth of the blocks, in
    which a contact or a reversal may show, is left out. At rest counts stand still, in motion they
    are noise. Three values show none.
    """
    if known.noise is None and len(values) <= 3:
        usual = 0.0
    elif known.noise is None:
        squared = np.diff(values, 3) ** 2 / 20.0
        blocks = [float(np.mean(b)) for b in np.array_split(squared, max(1, len(squared) // 50))]
        usual = float(np.nanmean(np.sort(blocks)[: max(1, round(0.9 * len(blocks)))]))
    else:
        usual = known.noise**2
    step = _count(values) if known.step is None else known.step
    return math.sqrt(max(usual, step**2 / 12.0))


def _count(values: FloatArray) -> float:
    """Return the step that every change of a reading is a multiple of; 0 where there is none.

    A shaft that never stands still shows a least change that no count of its encoder is behind.
    """
    steps = np.abs(np.diff(values))
    steps = steps[steps > 0.0]
    least = float(steps.min(initial=np.inf))
    if not math.isfinite(least):
        return 0.0
    counts = steps / least
    return least if float(np.median(np.abs(counts - np.round(counts)))) < WHOLE else 0.0
