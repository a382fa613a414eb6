"""Low-pass filters and the noise-robust derivative: zero-phase for analysis, causal for live use.

Every channel of a recording has the same filter: unequal smoothing of the channels of one equation
looks like a delay or a lag.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage, signal

from estimation.errors import EstimationError
from estimation.recording import FloatArray, Recording


class FilterError(EstimationError):
    """A signal is too short, too coarse or too broken for the requested filter."""


SHARE = 0.2
"""Usual cutoff, share of the sample rate."""

UNLIKELY = 10.0
"""Cutoff over the sample rate from which the rate is wrong, not the cutoff."""

POINTS, EXACT_DEGREE = 11, 4
"""Of the derivative: the published counts of the measured data (308,117 and 962,936 closing
samples) come out with them."""


@dataclass(frozen=True, slots=True)
class LowPass:
    """A Butterworth low-pass filter.

    Attributes:
        cutoff_hz: Frequency at which one pass of the filter has a gain of -3 dB, Hz. The zero-phase
            filter passes twice and has -6 dB there.
        order: Order of one pass.
    """

    cutoff_hz: float = 50.0
    order: int = 3

    def sections(self, sample_rate_hz: float) -> FloatArray:
        """Return the filter's second-order sections, shape (sections, 6).

        Raises:
            FilterError: The cutoff is not between 0 and half the sample rate.
        """
        # a rate worked out from time stamps is rounded: half of it is not a cutoff either way
        if not 0 < self.cutoff_hz < 0.4999 * sample_rate_hz or self.order < 1:
            raise FilterError(
                f"A {self.cutoff_hz} Hz low-pass of order {self.order} cannot be made at"
                f" {sample_rate_hz:.6g} samples a second.",
                "The cutoff must lie between 0 and half the sample rate, the order at 1 or more.",
                "Correct the unit of time_s in the machine's file."
                if self.cutoff_hz > UNLIKELY * sample_rate_hz
                else f"Write, for example, cutoff_hz = {SHARE * sample_rate_hz:.3g} under [machine]"
                " of the machine's file, or under [processing] of the model's.",
            )
        sections: FloatArray = signal.butter(
            self.order, self.cutoff_hz, fs=sample_rate_hz, output="sos"
        )
        return sections

    def for_rate(self, sample_rate_hz: float) -> "LowPass":
        """Return the filter with a cutoff of at most a fifth of a sample rate."""
        return replace(self, cutoff_hz=min(self.cutoff_hz, SHARE * sample_rate_hz))

    @property
    def reach_s(self) -> float:
        """Time over which one bad sample is spread in either direction, s."""
        return 1.0 / self.cutoff_hz


PAPER = LowPass(cutoff_hz=50.0, order=3)
"""The filter of O'Neill et al. 2018: order 3, 50 Hz."""


def zero_phase(values: FloatArray, sample_rate_hz: float, low_pass: LowPass = PAPER) -> FloatArray:
    """Filter values, shape (n,) or (n, channels), forwards and backwards: no lag, but not causal.

    The ends are continued by an odd reflection, so that a signal keeps its first and last value and
    slope.

    Raises:
        FilterError: Too few samples for the reflection, or the cutoff does not fit the rate.
    """
    sections = low_pass.sections(sample_rate_hz)
    # stated here, not left to scipy, so that the shortest signal can be named
    padding = 3 * (2 * len(sections) + 1)
    if len(values) <= padding:
        raise FilterError(
            f"{len(values)} samples are too few for a zero-phase filter.",
            f"Its ends are reflected over {padding} samples.",
            "Use a longer segment.",
        )
    filtered: FloatArray = signal.sosfiltfilt(sections, values, axis=0, padlen=padding)
    return filtered


class CausalFilter:
    """The one-pass filter as it runs live: sample by sample or batch by batch, state kept.

    It starts as if its first sample had always been there, so it has no start transient. The
    result does not depend on how the samples are cut into batches.
    """

    def __init__(self, sample_rate_hz: float, low_pass: LowPass = PAPER) -> None:
        self._sections = low_pass.sections(sample_rate_hz)
        self._state: FloatArray | None = None

    def restart(self) -> None:
        """Forget every sample so far."""
        self._state = None

    def step(self, values: FloatArray) -> FloatArray:
        """Filter the next samples, shape (n, channels)."""
        if len(values) == 0:
            return np.empty_like(values)
        if self._state is None:
            rest = signal.sosfilt_zi(self._sections)  # (sections, 2)
            self._state = rest[:, :, None] * values[0]
        filtered: FloatArray
        filtered, self._state = signal.sosfilt(self._sections, values, axis=0, zi=self._state)
        return filtered


def holoborodko_coefficients(points: int, exact_degree: int) -> FloatArray:
    """Return the coefficients of Holoborodko's smooth noise-robust differentiator.

    The derivative of f at sample 0, sample period h, is sum c_k (f_k - f_-k) / h, k = 1..(N-1)/2.
    Built from its frequency response: with the angular frequency w in radians a sample,
    H(w) = i sin w ((1 + cos w) / 2)^p (1 + q (1 - cos w)), where p is as high as the number of
    points allows (so the response dies out smoothly towards half the sample rate) and q makes the
    response exact to the degree asked for.

    Source: P. Holoborodko, "Smooth noise robust differentiators" (2008), families exact on
    polynomials of degree 2 and 4.

    Args:
        points: Length N of the stencil, odd; at least 3, or 5 for degree 4.
        exact_degree: 2 or 4.

    Returns:
        Coefficients c_1 .. c_((N-1)/2).

    Raises:
        FilterError: No such differentiator.
    """
    half = (points - 1) // 2
    if points % 2 == 0 or exact_degree not in (2, 4) or half < exact_degree // 2:
        raise FilterError(
            f"There is no {points}-point differentiator exact to degree {exact_degree}.",
            "The number of points is odd; the degree 2 (3 points or more) or 4 (5 or more).",
        )
    p = half - exact_degree // 2
    q = 1 / 3 + p / 2 if exact_degree == 4 else 0.0
    response = np.array([-0.5, 0.0, 0.5])  # i sin w, as a polynomial in exp(i w)
    for _ in range(p):
        response = np.convolve(response, [0.25, 0.5, 0.25])
    if exact_degree == 4:
        response = np.convolve(response, [-q / 2, 1 + q, -q / 2])
    return response[half + 1 :]


def holoborodko_derivative(values: ArrayLike, period_s: float) -> FloatArray:
    """Differentiate an even signal, shape (n,) or (n, k), with the noise-robust differentiator.

    Edges: where the stencil does not fit, the longest shorter one of the same family does the work,
    then the plain central difference, and at the very ends the one-sided difference of three
    points. All of them are exact on parabolas.

    Raises:
        FilterError: Fewer than three samples.
    """
    signal_values = np.asarray(values, dtype=np.float64)
    n = len(signal_values)
    if n < 3:
        raise FilterError(f"{n} samples cannot be differentiated; three are needed.")
    derivative = np.empty_like(signal_values)
    derivative[0] = [-1.5, 2.0, -0.5] @ signal_values[:3]
    derivative[-1] = [0.5, -2.0, 1.5] @ signal_values[-3:]
    # each longer stencil overwrites the samples it reaches
    for length in range(3, min(POINTS, n if n % 2 else n - 1) + 1, 2):
        degree = EXACT_DEGREE if length > EXACT_DEGREE else 2
        half = (length - 1) // 2
        inner = np.zeros((n - 2 * half, *signal_values.shape[1:]))
        for k, c in enumerate(holoborodko_coefficients(length, degree), start=1):
            inner += c * (
                signal_values[half + k : n - half + k] - signal_values[half - k : n - half - k]
            )
        derivative[half : n - half] = inner
    return derivative / period_s


def fill_gaps(ticks: NDArray[np.int64], rows: FloatArray) -> FloatArray:
    """Lay rows, shape (n, channels), on every tick, filling missing ticks by straight lines.

    `ticks` is the tick of each row, strictly increasing, the first one 0: row i of the input is at
    `ticks[i]` of the result, of shape (ticks[-1] + 1, channels).
    """
    if ticks[-1] + 1 == len(ticks):
        return rows
    every = np.arange(ticks[-1] + 1)
    return np.column_stack([np.interp(every, ticks, column) for column in rows.T])


def filter_recording(recording: Recording, low_pass: LowPass = PAPER) -> Recording:
    """Filter every channel of a recording with the same zero-phase filter.

    Lost samples are bridged by straight lines while filtering and not added. Values that are not
    finite are bridged likewise, and must be flagged. A flag spreads to the samples that the filter
    smears its sample over.

    Raises:
        FilterError: The run is too short, its clock jumps, or it holds a value that is not finite
            in a sample that carries no flag.
    """
    rate_hz = recording.sample_rate_hz
    names = list(recording.columns)
    ticks = recording.ticks
    short = int(np.count_nonzero(np.diff(ticks) < 1))
    if short or ticks[-1] > 10 * len(recording):
        period, even_hz = f"of {1e3 / rate_hz:.4g} ms", float(f"{rate_hz:.3g}")
        raise FilterError(
            f"The clock of run {recording.name!r} does not tick evenly.",
            f"{short} steps are shorter than half a period {period}."
            if short
            else f"{len(recording)} samples span {ticks[-1] + 1} periods {period}.",
            f"Write even_rate_hz = {even_hz:g} under [data] of the machine's file: each channel is"
            " interpolated onto an even clock."
            if short
            else "Split the run at the jump.",
        )
    rows = np.column_stack([recording[name] for name in names])
    if not np.isfinite(rows).all():
        rows = _bridged(recording, ticks, rows)
    filtered = zero_phase(fill_gaps(ticks, rows), rate_hz, low_pass)[ticks]
    return replace(
        recording,
        columns=dict(zip(names, filtered.T, strict=True)),
        flags=_spread(recording.flags, int(np.ceil(low_pass.reach_s * rate_hz))),
    )


def _bridged(recording: Recording, ticks: NDArray[np.int64], rows: FloatArray) -> FloatArray:
    """Replace values that are not finite, and flagged, by straight lines."""
    finite = np.isfinite(rows)
    if np.any(~finite[recording.valid]) or not finite.any(axis=0).all():
        raise FilterError(
            f"Run {recording.name!r} holds values that are not finite and carry no flag.",
            "A filter would spread them over the whole run.",
            "Flag these samples as missing where the data is imported.",
        )
    return np.column_stack(
        [
            np.interp(ticks, ticks[good], column[good])
            for column, good in zip(rows.T, finite.T, strict=True)
        ]
    )


def _spread(flags: NDArray[np.uint8], reach: int) -> NDArray[np.uint8]:
    """Widen every flag bit by `reach` samples to either side."""
    spread = np.zeros_like(flags)
    for bit in (1 << k for k in range(8)):
        at = (flags & bit) > 0
        if at.any():
            near = ndimage.binary_dilation(at, np.ones(2 * reach + 1, bool))
            spread |= np.where(near, bit, 0).astype(np.uint8)
    return spread
