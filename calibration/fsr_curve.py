"""The curve of a force-sensing resistor: force over voltage, refused beyond its range."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import ArrayLike
from scipy import stats

from calibration.errors import CalibrationError
from calibration.quality import BadDataError
from calibration.record import Fit
from estimation.recording import FloatArray


class FsrRangeError(CalibrationError):
    """A voltage outside what was calibrated."""


def is_monotone(coefficients: Sequence[float] | FloatArray, low: float, high: float) -> bool:
    """Return whether a polynomial, lowest power first, rises everywhere from low to high."""
    slope = polynomial.polyder(np.asarray(coefficients, dtype=np.float64))
    bends = polynomial.polyroots(polynomial.polytrim(polynomial.polyder(slope)))
    inside = [x.real for x in bends if abs(x.imag) < 1e-9 and low < x.real < high]
    return bool((polynomial.polyval(np.array([low, high, *inside]), slope) > 0).all())


@dataclass(frozen=True)
class FsrCurve:
    """Force over voltage, F = c0 + c1 x + c2 x^2 + ..., x in V and F in N."""

    coefficients: tuple[float, ...]
    low_v: float  # least voltage it holds for
    high_v: float  # greatest voltage it holds for
    # the coefficients and how well they are known; None for those of a paper
    fit: Fit | None = None
    runs: int = 0  # number of runs fitted on

    def __post_init__(self) -> None:
        if not (self.low_v < self.high_v and np.isfinite(self.coefficients).all()):
            raise CalibrationError("A curve has finite coefficients and a range from low to high.")
        if not is_monotone(self.coefficients, self.low_v, self.high_v):
            raise BadDataError(
                "not_monotone",
                f"The polynomial of degree {len(self.coefficients) - 1} falls somewhere between "
                f"{self.low_v:g} and {self.high_v:g} V.",
                "One voltage must mean one force, and more voltage more force.",
                "Choose a lower degree, or check the sign of the force.",
            )

    def force_n(self, fsr_v: ArrayLike) -> FloatArray:
        """Return the force at voltages, any shape.

        Raises:
            FsrRangeError: One lies outside the range.
        """
        volts = np.asarray(fsr_v, dtype=np.float64)
        outside = ~((volts >= self.low_v) & (volts <= self.high_v))
        if outside.any():
            raise FsrRangeError(
                f"{int(outside.sum())} of {volts.size} values lie outside"
                f" {self.low_v:g} .. {self.high_v:g} V.",
                "A polynomial is not valid beyond the calibrated range.",
                "Calibrate over a wider range, or exclude those samples.",
            )
        return np.asarray(polynomial.polyval(volts, np.array(self.coefficients)))

    def interval_n(self, fsr_v: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return the 95 % interval of one force at voltages, any shape.

        It is Student's with as many degrees of freedom as runs less one: samples of one run share
        its errors.

        Raises:
            FsrRangeError: One lies outside the range.
            CalibrationError: The curve comes without a covariance.
        """
        if self.fit is None or self.fit.residual_rms is None:
            raise CalibrationError("The curve comes without a covariance, so it has no interval.")
        force = self.force_n(fsr_v)
        powers = polynomial.polyvander(np.asarray(fsr_v, float), len(self.coefficients) - 1)
        curve = np.einsum("...i,ij,...j->...", powers, np.array(self.fit.covariance), powers)
        spread = np.sqrt(np.maximum(curve, 0.0) + self.fit.residual_rms**2)
        half = float(stats.t.ppf(0.975, self.runs - 1)) * spread
        return force - half, force + half


ZHANG_2022 = FsrCurve((0.105, 2.57, -4.63, 3.71), 0.0, 1.0)
"""Equation 5 of Zhang et al. 2022; x from 0 to 1 V."""
