"""Force-sensing resistor against a force sensor: a monotone polynomial, refused beyond its range.

The polynomial from amplified voltage to force is that of Zhang et al. 2022 (IEEE RA-L), equation 5.
Hysteresis (loading against unloading) and creep (drift with the logarithm of time) are measured,
not modelled: a single curve inherits them, and its interval is as wide as they make it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import polynomial
from scipy import stats
from scipy.linalg import block_diag

from calibration import quality
from calibration.fsr_curve import FsrCurve, is_monotone
from calibration.quality import BadDataError
from calibration.record import Fit
from calibration.regression import Regression, is_better, refuse_drift, regress
from estimation.recording import FloatArray

MINIMUM_RUNS = 3
MINIMUM_POINTS = 60
HYSTERESIS_BINS = 10
HYSTERESIS_LIMIT, DRIFT_LIMIT = 0.15, 0.05
"""Greatest hysteresis, and drift from the first to the last run, as shares of the span of force."""
HIGHEST_DEGREE = 5
WORTH = 0.05
"""A higher degree must lower the error on runs left out by more than this share to be taken."""


@dataclass(frozen=True)
class FsrRun:
    """One run of pressing the sensor on the force sensor.

    Attributes:
        time_s: Time, shape (n,), rising.
        fsr_v: Amplified voltage, shape (n,).
        force_n: Reference force, shape (n,).
    """

    name: str
    time_s: FloatArray
    fsr_v: FloatArray
    force_n: FloatArray

    def __post_init__(self) -> None:
        columns = [quality.finite(getattr(self, c), c) for c in ("time_s", "fsr_v", "force_n")]
        if len({column.size for column in columns}) != 1 or columns[0].size < 2:
            raise BadDataError("points", f"{self.name}: columns of unequal length, or empty.")
        if not (np.diff(columns[0]) > 0).all():
            raise BadDataError("points", f"{self.name}: time does not rise.")


@dataclass(frozen=True)
class FsrResult:
    """A fitted curve and what was measured on the way.

    Attributes:
        held_out_rmse_n: Degree to the error on runs left out, N; only of monotone degrees.
        hysteresis: Greatest force on loading less that on unloading at one voltage, over the span
            of force; None where the runs do not go both ways.
        drift: Mean residual of the last run less that of the first, over the span of force.
    """

    curve: FsrCurve
    held_out_rmse_n: dict[int, float]
    hysteresis: float | None
    drift: float


@dataclass(frozen=True, slots=True)
class Creep:
    """Drift at constant force, v(t) = v1 (1 + rate log10(t / t1)).

    Attributes:
        rate: Relative change a decade of time.
        standard_error: Of the rate, samples taken as independent.
    """

    rate: float
    standard_error: float


def fit_fsr(
    runs: Sequence[FsrRun],
    degree: int | None = None,
    *,
    force_at_zero_n: float | None = None,
    rail_v: float = 1.0,
) -> FsrResult:
    """Fit force over voltage on all runs.

    Args:
        runs: The runs, in the order they were made.
        degree: Degree of the polynomial. If None, the lowest one whose error on runs left out is
            within one standard error of the runs' differences, or within 5 %, of the least.
        force_at_zero_n: Force at 0 V, held fixed; fitted if None.
        rail_v: Upper end of the amplifier's range.

    Raises:
        BadDataError: The data are not sufficient for a calibration; its `rule` is the reason.
    """
    volts, forces = _checked(runs, degree or 1, rail_v)
    span = float(np.ptp(forces))
    hysteresis = hysteresis_ratio(runs)
    if hysteresis is not None:
        fix = "Condition the sensor by loading it to 110 % several times, and press more slowly."
        quality.check_limit("hysteresis", hysteresis, HYSTERESIS_LIMIT, "Hysteresis", fix)
    tried = range(1, HIGHEST_DEGREE + 1) if degree is None else (degree,)
    low, high = float(volts.min()), float(volts.max())
    held = [] if force_at_zero_n is None else [force_at_zero_n]
    fits = {
        d: fit
        for d in tried
        if is_monotone([*held, *(fit := _fitted(runs, d, held)).values], low, high)
    }
    if not fits:
        raise BadDataError(
            "not_monotone",
            f"No polynomial of degree {', '.join(map(str, tried))} rises over the whole range.",
            "One voltage must mean one force, and more voltage more force.",
            "Try a lower degree, or check the sign of the force.",
        )
    chosen = _lowest_as_good(fits)
    quality.check_levels(volts, chosen + 2, "The voltage")
    fit = fits[chosen]
    # a coefficient held fixed has no variance
    covariance = block_diag(np.zeros((len(held), len(held))), fit.covariance)
    coefficients = [*held, *fit.values.tolist()]
    names = {f"c{k}": value for k, value in enumerate(coefficients)}
    kept = Fit("polynomial", names, covariance, fit.residual_rms, fit.size)
    curve = FsrCurve(tuple(coefficients), low, high, kept, len(runs))
    fix = "Let the sensor rest between runs, and record again."
    drift = refuse_drift(fit, span, DRIFT_LIMIT, fix)
    rmse = {d: float(np.sqrt(fit.held_out.mean())) for d, fit in fits.items()}
    return FsrResult(curve, rmse, hysteresis, drift)


def hysteresis_ratio(runs: Sequence[FsrRun]) -> float | None:
    """Return how far loading and unloading are apart, over the span of force.

    Samples are sorted by whether force rises or falls by more than 5 % of its greatest rate. It is
    the greatest difference of the mean forces in equal bins of voltage; None where no bin has both.
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
    trend = polynomial.polyval(volts, polynomial.polyfit(volts, forces, 3))
    for k in range(HYSTERESIS_BINS):
        up = (bins == k) & (rates > least)
        down = (bins == k) & (rates < -least)
        if up.sum() >= 3 and down.sum() >= 3:
            difference = (forces - trend)[up].mean() - (forces - trend)[down].mean()
            apart.append(abs(float(difference)))
    return max(apart) / span if apart and span > 0 else None


def measure_creep(hold: FsrRun, start_s: float) -> Creep:
    """Measure creep in a run at constant force, from a time after the force has settled.

    The run's `time_s` counts from when the force was put on.

    Raises:
        BadDataError: The force is not constant to 2 %, or the time is less than a decade.
    """
    keep = hold.time_s >= start_s
    quality.check_points(int(keep.sum()), MINIMUM_POINTS, "samples")
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
    start = float(line.intercept)
    return Creep(float(line.slope) / start, float(line.stderr) / abs(start))


def _checked(runs: Sequence[FsrRun], degree: int, rail_v: float) -> tuple[FloatArray, FloatArray]:
    quality.check_points(len(runs), MINIMUM_RUNS, "runs")
    if degree < 1:
        raise BadDataError("levels", f"A polynomial of degree {degree} does not rise.")
    volts = np.concatenate([run.fsr_v for run in runs])
    forces = np.concatenate([run.force_n for run in runs])
    quality.check_points(volts.size, MINIMUM_POINTS, "samples")
    quality.check_change(volts, 0.05 * rail_v, "The voltage")
    quality.check_change(forces, 1e-3, "The force")
    quality.check_rails(volts, None, rail_v, "the voltages")
    quality.check_rails(forces, None, None, "the forces")
    quality.check_levels(volts, degree + 2, "The voltage")
    return volts, forces


def _fitted(runs: Sequence[FsrRun], degree: int, held: list[float]) -> Regression:
    """Fit the powers of the voltage; the constant one only where the force at 0 V is not held."""
    pairs: list[tuple[FloatArray, FloatArray]] = []
    for run in runs:
        powers = np.asarray(polynomial.polyvander(run.fsr_v, degree)[:, len(held) :], np.float64)
        pairs.append((powers, run.force_n - sum(held)))
    return regress(pairs)


def _lowest_as_good(fits: dict[int, Regression]) -> int:
    """Return the lowest degree that is not worse on runs left out than the best one."""
    best = min(fits, key=lambda d: float(fits[d].held_out.mean()))
    least = np.sqrt(fits[best].held_out.mean())
    for degree in sorted(fits):
        squares = fits[degree].held_out
        is_worth_it = np.sqrt(squares.mean()) > (1 + WORTH) * least
        if not (is_worth_it and is_better(fits[best].held_out, squares)):
            return degree
    return best
