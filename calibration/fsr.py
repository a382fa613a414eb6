"""Force-sensing resistor against a force sensor: a monotone polynomial, refused beyond its range.

The polynomial from amplified voltage to force is that of Zhang et al. 2022 (IEEE RA-L), equation 5.
Hysteresis (loading against unloading) and creep (drift with the logarithm of time) are measured,
not modelled: a single curve inherits them, and its interval is as wide as they make it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.polynomial import polynomial
from scipy import stats

from calibration.fsr_curve import FsrCurve, is_monotone
from calibration.quality import (
    BadDataError,
    check_change,
    check_levels,
    check_limit,
    check_points,
    check_rails,
    finite,
)
from estimation.recording import FloatArray

MINIMUM_RUNS = 3
MINIMUM_POINTS = 60
HYSTERESIS_BINS = 10
HIGHEST_DEGREE = 5
WORTH = 0.05
"""A higher degree must lower the error on runs left out by more than this share to be taken."""


@dataclass(frozen=True)
class FsrRun:
    """One run of pressing the sensor on the force sensor.

    Attributes:
        name: Name of the run.
        time_s: Time, shape (n,), rising.
        fsr_v: Amplified voltage, shape (n,).
        force_n: Reference force, shape (n,).
    """

    name: str
    time_s: FloatArray
    fsr_v: FloatArray
    force_n: FloatArray

    def __post_init__(self) -> None:
        columns = [finite(getattr(self, c), c) for c in ("time_s", "fsr_v", "force_n")]
        if len({column.size for column in columns}) != 1 or columns[0].size < 2:
            raise BadDataError("points", f"{self.name}: columns of unequal length, or empty.")
        if not (np.diff(columns[0]) > 0).all():
            raise BadDataError("points", f"{self.name}: time does not rise.")


@dataclass(frozen=True)
class FsrResult:
    """A fitted curve and what was measured on the way.

    Attributes:
        curve: The curve.
        held_out_rmse_n: Degree to the error on runs left out, N; only of monotone degrees.
        hysteresis: Greatest force on loading less that on unloading at one voltage, over the span
            of force; None where the runs do not go both ways.
        drift: Mean residual of the last run less that of the first, over the span of force.
    """

    curve: FsrCurve
    held_out_rmse_n: dict[int, float] = field(default_factory=dict)
    hysteresis: float | None = None
    drift: float = 0.0


@dataclass(frozen=True, slots=True)
class Creep:
    """Drift at constant force, v(t) = v1 (1 + rate log10(t / t1)).

    Attributes:
        rate: Relative change a decade of time.
        standard_error: Of the rate, samples taken as independent.
        decades: Decades of time it was measured over.
    """

    rate: float
    standard_error: float
    decades: float


def fit_fsr(
    runs: Sequence[FsrRun],
    degree: int | None = None,
    *,
    force_at_zero_n: float | None = None,
    rail_v: float = 1.0,
    hysteresis_limit: float = 0.15,
    drift_limit: float = 0.05,
) -> FsrResult:
    """Fit force over voltage on all runs.

    Args:
        runs: The runs, in the order they were made.
        degree: Degree of the polynomial. If None, the lowest one whose error on runs left out is
            within one standard error of the runs' differences, or within 5 %, of the least.
        force_at_zero_n: Force at 0 V, held fixed; fitted if None.
        rail_v: Upper end of the amplifier's range.
        hysteresis_limit: Greatest hysteresis that passes, share of the span of force.
        drift_limit: Greatest drift from first to last run that passes, share of the span of force.

    Raises:
        BadDataError: The data are not sufficient for a calibration; its `rule` is the reason.
    """
    volts, forces = _checked(runs, degree or 1, rail_v)
    span = float(np.ptp(forces))
    hysteresis = hysteresis_ratio(runs)
    if hysteresis is not None:
        fix = "Condition the sensor by loading it to 110 % several times, and press more slowly."
        check_limit("hysteresis", hysteresis, hysteresis_limit, "Hysteresis", fix)
    tried = range(1, HIGHEST_DEGREE + 1) if degree is None else (degree,)
    errors = {}
    for d in tried:
        whole = _solve(volts, forces, d, force_at_zero_n)
        if is_monotone(whole, float(volts.min()), float(volts.max())):
            errors[d] = _held_out_squares(runs, d, force_at_zero_n)
    if not errors:
        raise BadDataError(
            "not_monotone",
            f"No polynomial of degree {', '.join(map(str, tried))} rises over the whole range.",
            "One voltage must mean one force, and more voltage more force.",
            "Try a lower degree, or check the sign of the force.",
        )
    chosen = _lowest_as_good(errors)
    check_levels(volts, chosen + 2, "The voltage")
    curve = _curve(runs, chosen, force_at_zero_n)
    drift = (_mean_residual(curve, runs[-1]) - _mean_residual(curve, runs[0])) / span
    fix = "Let the sensor rest between runs, and record again."
    check_limit("drift", abs(drift), drift_limit, "Drift from first to last run", fix)
    rmse = {d: float(np.sqrt(squares.mean())) for d, squares in errors.items()}
    return FsrResult(curve, rmse, hysteresis, drift)


def hysteresis_ratio(runs: Sequence[FsrRun]) -> float | None:
    """Return how far loading and unloading are apart, over the span of force.

    Samples are sorted by whether force rises or falls by more than 5 % of its greatest rate, and
    compared in equal bins of voltage.

    Returns:
        The greatest difference of the mean forces of a bin; None where no bin has both.
    """
    volts = np.concatenate([run.fsr_v for run in runs])
    forces = np.concatenate([run.force_n for run in runs])
    rates = np.concatenate([np.gradient(run.force_n, run.time_s) for run in runs])
    span = float(np.ptp(forces))
    edges = np.linspace(volts.min(), volts.max(), HYSTERESIS_BINS + 1)
    bins = np.clip(np.digitize(volts, edges) - 1, 0, HYSTERESIS_BINS - 1)
    least = 0.05 * np.abs(rates).max()
    apart = []
    # a slope within the bin would count as a difference where the two are spread differently
    trend = polynomial.polyval(volts, _solve(volts, forces, 3, None))
    for k in range(HYSTERESIS_BINS):
        up = (bins == k) & (rates > least)
        down = (bins == k) & (rates < -least)
        if up.sum() >= 3 and down.sum() >= 3:
            difference = (forces - trend)[up].mean() - (forces - trend)[down].mean()
            apart.append(abs(float(difference)))
    return max(apart) / span if apart and span > 0 else None


def measure_creep(hold: FsrRun, start_s: float) -> Creep:
    """Measure creep in a run at constant force.

    Args:
        hold: The run; `time_s` counts from when the force was put on.
        start_s: When to begin, after the force has settled.

    Raises:
        BadDataError: The force is not constant to 2 %, or the time is less than a decade.
    """
    keep = hold.time_s >= start_s
    check_points(int(keep.sum()), MINIMUM_POINTS, "samples")
    time, volts, force = hold.time_s[keep], hold.fsr_v[keep], hold.force_n[keep]
    if start_s <= 0 or time[-1] / time[0] < 10:
        raise BadDataError("points", f"{hold.name}: creep needs a decade of time, from after 0 s.")
    if np.ptp(force) > 0.02 * abs(force.mean()):
        raise BadDataError(
            "not_steady",
            f"{hold.name}: the force goes from {force.min():.4g} to {force.max():.4g} N.",
            "Creep is what the voltage does at constant force; at most 2 % passes.",
            "Hold the force by a weight.",
        )
    line = stats.linregress(np.log10(time / time[0]), volts)
    decades = float(np.log10(time[-1] / time[0]))
    start = float(line.intercept)
    return Creep(float(line.slope) / start, float(line.stderr) / abs(start), decades)


def _checked(runs: Sequence[FsrRun], degree: int, rail_v: float) -> tuple[FloatArray, FloatArray]:
    check_points(len(runs), MINIMUM_RUNS, "runs")
    if degree < 1:
        raise BadDataError("levels", f"A polynomial of degree {degree} does not rise.")
    volts = np.concatenate([run.fsr_v for run in runs])
    forces = np.concatenate([run.force_n for run in runs])
    check_points(volts.size, MINIMUM_POINTS, "samples")
    check_change(volts, 0.05 * rail_v, "The voltage")
    check_change(forces, 1e-3, "The force")
    check_rails(volts, None, rail_v, "the voltages")
    check_rails(forces, None, None, "the forces")
    check_levels(volts, degree + 2, "The voltage")
    return volts, forces


def _solve(
    volts: FloatArray, forces: FloatArray, degree: int, force_at_zero_n: float | None
) -> FloatArray:
    powers = polynomial.polyvander(volts, degree)
    if force_at_zero_n is None:
        return np.asarray(np.linalg.lstsq(powers, forces)[0])
    rest = np.linalg.lstsq(powers[:, 1:], forces - force_at_zero_n)[0]
    return np.concatenate([[force_at_zero_n], rest])


def _held_out_squares(
    runs: Sequence[FsrRun], degree: int, force_at_zero_n: float | None
) -> FloatArray:
    """Return each run's mean square error by the curve fitted on all others, shape (runs,)."""
    squares = []
    for left_out in runs:
        others = [run for run in runs if run is not left_out]
        volts = np.concatenate([run.fsr_v for run in others])
        forces = np.concatenate([run.force_n for run in others])
        curve = _solve(volts, forces, degree, force_at_zero_n)
        error = left_out.force_n - polynomial.polyval(left_out.fsr_v, curve)
        squares.append(float(np.mean(error**2)))
    return np.array(squares)


def _lowest_as_good(errors: dict[int, FloatArray]) -> int:
    best = min(errors, key=lambda d: float(errors[d].mean()))
    for degree in sorted(errors):
        worse = errors[degree] - errors[best]
        differs = worse.mean() > worse.std(ddof=1) / np.sqrt(worse.size)
        is_worth_it = np.sqrt(errors[degree].mean()) > (1 + WORTH) * np.sqrt(errors[best].mean())
        if not (differs and is_worth_it):
            return degree
    return best


def _curve(runs: Sequence[FsrRun], degree: int, force_at_zero_n: float | None) -> FsrCurve:
    """Fit all runs; the covariance takes the samples of one run as one piece of evidence."""
    volts = np.concatenate([run.fsr_v for run in runs])
    forces = np.concatenate([run.force_n for run in runs])
    solved = _solve(volts, forces, degree, force_at_zero_n)
    first = 0 if force_at_zero_n is None else 1  # a coefficient held fixed has no variance
    powers = polynomial.polyvander(volts, degree)[:, first:]
    bread = np.linalg.pinv(powers.T @ powers)
    meat = np.zeros_like(bread)
    for run in runs:
        error = run.force_n - polynomial.polyval(run.fsr_v, solved)
        score = polynomial.polyvander(run.fsr_v, degree)[:, first:].T @ error
        meat += np.outer(score, score)
    covariance = np.zeros((degree + 1, degree + 1))
    covariance[first:, first:] = bread @ meat @ bread * len(runs) / (len(runs) - 1)
    residual = forces - polynomial.polyval(volts, solved)
    return FsrCurve(
        coefficients=tuple(solved.tolist()),
        low_v=float(volts.min()),
        high_v=float(volts.max()),
        covariance=tuple(map(tuple, covariance.tolist())),
        residual_rms_n=float(np.sqrt(np.mean(residual**2))),
        runs=len(runs),
        points=int(volts.size),
    )


def _mean_residual(curve: FsrCurve, run: FsrRun) -> float:
    return float(np.mean(run.force_n - curve.force_n(run.fsr_v)))
