"""Hysteresis and creep of a force-sensing resistor, which a single curve cannot represent.

    F = p(x) + (g / 2) s w(u)          w(u) = 4 u (1 - u)

x is the voltage with its creep taken off, x = v / (1 + r log10(t / t1)), t the time under load; u
goes from 0 to 1 over the calibrated range, s is 1 on loading and -1 on unloading, g the greatest
gap between the two. The lens w closes at both ends, as a loop does that was driven through all of
the range; loops within it are narrower, so g is what a whole press shows.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibration.fsr import Creep, FsrRun
from calibration.fsr_curve import FsrCurve
from calibration.regression import is_better, regress
from estimation.recording import FloatArray

CREEP_START_S = 0.1
"""Creep counts from so long after the load came."""


@dataclass(frozen=True, slots=True)
class FsrMemory:
    """What the sensor remembers.

    Attributes:
        gap_n: Force on loading minus that on unloading at mid-range; 0 where it does not improve
            runs left out.
        gap_standard_error_n: Of the gap, runs as the unit.
        creep_ratio: Relative rise of the voltage per decade of time; 0 where not significant.
        held_out_rmse_n: Error on runs left out, without and with the gap.
    """

    gap_n: float = 0.0
    gap_standard_error_n: float = 0.0
    creep_ratio: float = 0.0
    held_out_rmse_n: tuple[float, float] = (float("nan"), float("nan"))

    def force_n(self, curve: FsrCurve, time_s: FloatArray, fsr_v: FloatArray) -> FloatArray:
        """Return the force of one press, shape (n,).

        It begins where the voltage exceeds the lowest tenth. Time, s, rises; the voltage is smooth
        enough for the sign of its slope.

        Raises:
            FsrRangeError: A voltage lies outside the curve's range.
        """
        volts = self.without_creep(curve, time_s, fsr_v)
        return curve.force_n(volts) + self.gap_n * _half_loop(curve, time_s, volts)

    def memoryless(self, curve: FsrCurve, run: FsrRun) -> FsrRun:
        """Return a run as a sensor without memory would have given it."""
        volts = self.without_creep(curve, run.time_s, run.fsr_v)
        bias_n = self.gap_n * _half_loop(curve, run.time_s, volts)
        return FsrRun(run.name, run.time_s, volts, run.force_n - bias_n)

    def without_creep(self, curve: FsrCurve, time_s: FloatArray, fsr_v: FloatArray) -> FloatArray:
        """Return the voltage with its creep taken off, shape (n,)."""
        if self.creep_ratio == 0.0:
            return fsr_v
        floor = curve.low_v + 0.1 * (curve.high_v - curve.low_v)
        loaded = fsr_v > floor
        begins = np.where(loaded & ~np.roll(loaded, 1), time_s, -np.inf)
        begins[0] = time_s[0]
        since = time_s - np.maximum.accumulate(begins)
        decades = np.log10(np.maximum(since, CREEP_START_S) / CREEP_START_S)
        return np.where(loaded, fsr_v / (1.0 + self.creep_ratio * decades), fsr_v)


def fit_memory(curve: FsrCurve, runs: Sequence[FsrRun], creep: Creep | None) -> FsrMemory:
    """Measure what a curve's runs of whole presses remember, and keep what predicts runs left out.

    The creep is that under a constant load; None where it was not measured.
    """
    pairs = []
    for run in runs:
        column = _half_loop(curve, run.time_s, run.fsr_v)
        pairs.append((column[:, None], run.force_n - curve.force_n(run.fsr_v)))
    gaps = np.array([float(x[:, 0] @ left / (x[:, 0] @ x[:, 0])) for x, left in pairs])
    fit = regress(pairs)
    without = np.array([np.mean(left**2) for _, left in pairs])
    creeps = creep is not None and abs(creep.rate) > 3 * creep.standard_error
    return FsrMemory(
        gap_n=float(fit.values[0]) if is_better(fit.held_out, without) else 0.0,
        gap_standard_error_n=float(gaps.std(ddof=1) / np.sqrt(gaps.size)),
        creep_ratio=creep.rate if creeps and creep is not None else 0.0,
        held_out_rmse_n=(float(np.sqrt(without.mean())), float(np.sqrt(fit.held_out.mean()))),
    )


def _half_loop(curve: FsrCurve, time_s: FloatArray, fsr_v: FloatArray) -> FloatArray:
    """Return s w(u) / 2; s is 1 where the voltage rises, -1 where it falls, held where it rests."""
    share = np.clip((fsr_v - curve.low_v) / (curve.high_v - curve.low_v), 0.0, 1.0)
    rate = np.gradient(fsr_v, time_s)
    least = 0.05 * np.abs(rate).max()
    sign = np.where(rate > least, 1.0, np.where(rate < -least, -1.0, 0.0))
    last = np.maximum.accumulate(np.where(sign != 0, np.arange(sign.size), 0))
    return np.asarray(0.5 * (4.0 * share * (1.0 - share)) * sign[last])
