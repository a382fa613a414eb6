"""Torque sensor: shunt check against the certificate, and a line through known weights on an arm.

The shunt check tests excitation, wiring and gain, not the sensitivity of the mechanics; the weights
test everything. Do both at a known temperature, before and after a series of runs.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from calibration import quality
from calibration.quality import BadDataError
from calibration.record import LINE, Fit
from estimation.recording import FloatArray

STANDARD_GRAVITY_M_S2 = 9.80665
MINIMUM_READINGS = 100
MINIMUM_STEPS = 6
MINIMUM_LEVELS = 4
RAILS_COUNTS = (-32768.0, 32767.0)
"""Least and greatest count of the converter."""
SHUNT_TOLERANCE = 0.01
"""Greatest relative deviation from the certificate that passes."""
LINEARITY_LIMIT, HYSTERESIS_LIMIT, DRIFT_LIMIT = 0.01, 0.01, 0.005
"""Greatest departure from the line, hysteresis and drift of the zero, as shares of the span."""


def weight_torque_n_m(mass_kg: ArrayLike, arm_m: float) -> FloatArray:
    """Return the torque of masses, any shape, at the end of a level arm, N m."""
    return np.asarray(np.asarray(mass_kg, dtype=np.float64) * STANDARD_GRAVITY_M_S2 * arm_m)


def check_shunt(
    unloaded: ArrayLike, shunted: ArrayLike, certificate_v_v: float, counts_per_v_v: float
) -> float:
    """Return the change a shunt makes over the one its certificate states, less one.

    The readings, shape (n,), are counts without the shunt and with it; the change by the
    certificate is in V/V. A shunt of Rs across one arm of an equal-arm bridge of R gives
    R / (4 Rs + 2 R) (Yokogawa DL850E manual; Vishay TN-514).

    Raises:
        BadDataError: Too few readings, at a rail, drifting, no change beyond the noise, or another
            change than the certificate's.
    """
    means, errors = [], []
    for name, values in (("unloaded", unloaded), ("shunted", shunted)):
        readings = _at_rest(values, name)
        means.append(float(readings.mean()))
        errors.append(float(readings.std(ddof=1)) / np.sqrt(readings.size))
    change = means[1] - means[0]
    certificate = certificate_v_v * counts_per_v_v
    if not (np.isfinite(certificate) and certificate != 0):
        raise BadDataError("points", f"The certificate's change of {certificate} cannot be.")
    if abs(change) <= max(5 * float(np.hypot(*errors)), 0.01 * abs(certificate)):
        raise BadDataError(
            "no_change",
            f"The shunt changes the reading by {change:.4g} counts.",
            f"By the certificate it is {certificate:.4g}.",
            "Check that the shunt is switched on and the bridge is excited.",
        )
    deviation = change / certificate - 1.0
    if abs(deviation) > SHUNT_TOLERANCE:
        raise BadDataError(
            "shunt",
            f"The shunt changes the reading by {change:.0f} counts, "
            f"by the certificate {certificate:.0f}.",
            f"That is {deviation:+.2%}; {SHUNT_TOLERANCE:.0%} passes.",
            "Check wiring, excitation and the amplifier's gain before hanging weights.",
        )
    return deviation


@dataclass(frozen=True)
class Step:
    """Readings under one weight.

    Attributes:
        torque_n_m: Known torque, closing positive.
        counts: Readings at rest, shape (n,).
    """

    torque_n_m: float
    counts: FloatArray


@dataclass(frozen=True)
class TorqueResult:
    """The line through known torques, torque = slope (counts - zero).

    Attributes:
        fit: Slope, N m a count, and zero, counts.
        linearity: Greatest residual of a level's mean, over the span of torque.
        hysteresis: Greatest difference of loading and unloading at one level, over the span; None
            where no level was reached both ways.
        drift: Change of the unloaded reading from the first to the last step, over the span; None
            where the series does not begin and end unloaded.
        counts: Mean reading of each step, shape (n,).
        torque_n_m: Torque of each step, shape (n,).
        residual_n_m: Torque by the line less that of the step, shape (n,).
    """

    fit: Fit
    linearity: float
    hysteresis: float | None
    drift: float | None
    counts: FloatArray
    torque_n_m: FloatArray
    residual_n_m: FloatArray


def fit_torque(steps: Sequence[Step]) -> TorqueResult:
    """Fit the line through the steps' mean readings, each step one piece of evidence.

    The steps are in the order they were made: up through the levels and down again.

    Raises:
        BadDataError: The data are not sufficient for a calibration; its `rule` is the reason.
    """
    quality.check_points(len(steps), MINIMUM_STEPS, "steps")
    for k, step in enumerate(steps):
        _at_rest(step.counts, f"step {k + 1}")
    torques = quality.finite([step.torque_n_m for step in steps], "the torques")
    counts = np.array([step.counts.mean() for step in steps])
    noise = float(np.median([step.counts.std(ddof=1) for step in steps]))
    quality.check_change(torques, 1e-9, "The torque")
    quality.check_levels(torques, MINIMUM_LEVELS, "The torque")
    quality.check_change(counts, max(10 * noise, 10.0), "The mean reading")

    # the readings carry the error: fitted over the torques, then the line is turned round
    line = stats.linregress(torques, counts)
    if float(line.slope) == 0.0:
        raise BadDataError("no_change", "The readings do not follow the torque at all.")
    slope, zero = 1.0 / float(line.slope), float(line.intercept)
    residual = (counts - zero) * slope - torques
    span = float(np.ptp(torques))
    departures = [residual[torques == level].mean() for level in np.unique(torques)]
    linearity = float(np.abs(departures).max()) / span
    hysteresis, drift = _hysteresis(torques, residual, span), None
    if torques[0] == 0.0 and torques[-1] == 0.0:
        drift = float(residual[-1] - residual[0]) / span
        fix = "Let the amplifier warm up, and repeat."
        quality.check_limit("drift", abs(drift), DRIFT_LIMIT, "Drift of the zero", fix)
    if hysteresis is not None:
        fix = "Look for friction in the arm and for a loose mounting."
        quality.check_limit("hysteresis", hysteresis, HYSTERESIS_LIMIT, "Hysteresis", fix)
    fix = "Check the masses, and that the arm stays level."
    quality.check_limit("not_linear", linearity, LINEARITY_LIMIT, "The departure from a line", fix)
    apart = -float(torques.mean()) * line.stderr**2
    spread = np.array([[line.stderr**2, apart], [apart, line.intercept_stderr**2]])
    turned = np.diag([-(slope**2), 1.0])
    rms = float(np.sqrt(np.mean(residual**2)))
    parameters = {"slope": slope, "zero": zero}
    fit = Fit(LINE, parameters, turned @ spread @ turned, rms, len(steps))
    return TorqueResult(fit, linearity, hysteresis, drift, counts, torques, residual)


def _at_rest(values: ArrayLike, name: str) -> FloatArray:
    """Return readings, refused where they are few, at a rail, or do not rest.

    Their halves may differ by the noise of one reading, and by a count.
    """
    readings = quality.finite(values, f"the readings of {name}")
    quality.check_points(readings.size, MINIMUM_READINGS, f"readings of {name}")
    quality.check_rails(readings, *RAILS_COUNTS, f"the readings of {name}", pile_up=False)
    first, last = np.array_split(readings, 2)
    moved = abs(float(last.mean() - first.mean()))
    if moved > max(float(np.std(np.diff(readings))) / np.sqrt(2), 1.0):
        raise BadDataError(
            "not_steady",
            f"{name}: the reading moves by {moved:.4g} counts while it should rest.",
            "That is more than the noise of one reading.",
            "Wait until the weight hangs still.",
        )
    return readings


def _hysteresis(torques: FloatArray, residual: FloatArray, span: float) -> float | None:
    """Return the greatest difference between a level reached from below and from above."""
    rising = np.diff(torques, prepend=torques[0]) > 0
    falling = np.diff(torques, prepend=torques[0]) < 0
    apart = [
        abs(float(residual[here & rising].mean() - residual[here & falling].mean()))
        for here in (torques == level for level in np.unique(torques))
        if (here & rising).any() and (here & falling).any()
    ]
    return max(apart) / span if apart else None
