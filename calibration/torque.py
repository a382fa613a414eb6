"""Torque sensor: shunt check against the certificate, and a line through known weights on an arm.

The shunt check tests excitation, wiring and gain, not the sensitivity of the mechanics; the weights
test everything. Do both at a known temperature, before and after a series of runs.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from calibration.quality import (
    BadDataError,
    check_change,
    check_levels,
    check_limit,
    check_points,
    check_rails,
    finite,
)
from calibration.record import LINE, Fit
from estimation.recording import FloatArray

STANDARD_GRAVITY_M_S2 = 9.80665
MINIMUM_READINGS = 100
MINIMUM_STEPS = 6
MINIMUM_LEVELS = 4


def shunt_ratio(shunt_ohm: float, bridge_ohm: float = 350.0) -> float:
    """Return the output a shunt across one arm of an equal-arm bridge gives, V/V of excitation.

    Vo/Vex = R / (4 Rs + 2 R); Yokogawa DL850E manual, appendix, and Vishay TN-514.

    Args:
        shunt_ohm: Rs.
        bridge_ohm: R, resistance of each arm.
    """
    if not (shunt_ohm > 0 and bridge_ohm > 0):
        raise BadDataError("points", f"Resistances {shunt_ohm} and {bridge_ohm} ohm cannot be.")
    return bridge_ohm / (4 * shunt_ohm + 2 * bridge_ohm)


def weight_torque_n_m(
    mass_kg: ArrayLike,
    arm_m: float,
    arm_from_horizontal_rad: float = 0.0,
    gravity_m_s2: float = STANDARD_GRAVITY_M_S2,
) -> FloatArray:
    """Return the torque of masses at the end of an arm, N m.

    Args:
        mass_kg: Masses, any shape.
        arm_m: Length of the arm from the axis to where the mass hangs.
        arm_from_horizontal_rad: Angle of the arm.
        gravity_m_s2: Local gravity.
    """
    lever_m = arm_m * np.cos(arm_from_horizontal_rad)
    return np.asarray(np.asarray(mass_kg, dtype=np.float64) * gravity_m_s2 * lever_m)


@dataclass(frozen=True, slots=True)
class ShuntCheck:
    """A sensor with and without its shunt.

    Attributes:
        unloaded_counts: Mean reading without the shunt.
        shunted_counts: Mean reading with it.
        change_counts: Shunted less unloaded.
        certificate_counts: The change by the certificate.
        deviation: Change over the certificate's, less one.
        tolerance: Greatest deviation that passes.
    """

    unloaded_counts: float
    shunted_counts: float
    change_counts: float
    certificate_counts: float
    deviation: float
    tolerance: float

    @property
    def passes(self) -> bool:
        """Whether the deviation is within the tolerance."""
        return abs(self.deviation) <= self.tolerance


def check_shunt(
    unloaded: ArrayLike,
    shunted: ArrayLike,
    certificate_v_v: float,
    counts_per_v_v: float,
    tolerance: float = 0.01,
    rails_counts: tuple[float, float] | None = None,
) -> ShuntCheck:
    """Compare the change a shunt makes with the one its certificate states.

    Args:
        unloaded: Readings without the shunt, counts, shape (n,).
        shunted: Readings with it, counts, shape (m,).
        certificate_v_v: Change by the certificate, V/V; see `shunt_ratio` where it states ohms.
        counts_per_v_v: Gain of amplifier and converter.
        tolerance: Greatest relative deviation that passes.
        rails_counts: Least and greatest count of the converter.

    Raises:
        BadDataError: Too few readings, at a rail, drifting, or no change beyond the noise.
    """
    means, errors = [], []
    for name, values in (("unloaded", unloaded), ("shunted", shunted)):
        readings = finite(values, f"the {name} readings")
        check_points(readings.size, MINIMUM_READINGS, f"{name} readings")
        if rails_counts is not None:
            check_rails(readings, *rails_counts, f"the {name} readings", pile_up=False)
        _check_steady(readings, name)
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
    return ShuntCheck(
        means[0], means[1], change, certificate, change / certificate - 1.0, tolerance
    )


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
        slope_n_m: Torque of a count.
        zero_counts: Counts at no torque.
        covariance: Of slope and zero, shape (2, 2).
        residual_rms_n_m: Root mean square residual of the steps.
        linearity: Greatest residual of a level's mean, over the span of torque.
        hysteresis: Greatest difference of loading and unloading at one level, over the span; None
            where no level was reached both ways.
        drift: Change of the unloaded reading from the first to the last step, over the span; None
            where the series does not begin and end unloaded.
        low_counts: Least mean reading.
        high_counts: Greatest mean reading.
        steps: Number of steps.
    """

    slope_n_m: float
    zero_counts: float
    covariance: tuple[tuple[float, ...], ...]
    residual_rms_n_m: float
    linearity: float
    hysteresis: float | None
    drift: float | None
    low_counts: float
    high_counts: float
    steps: int

    def as_fit(self) -> Fit:
        """Return it as a calibration record keeps it."""
        parameters = {"slope": self.slope_n_m, "zero": self.zero_counts}
        return Fit(LINE, parameters, self.covariance, self.residual_rms_n_m, self.steps)


def fit_torque(
    steps: Sequence[Step],
    *,
    rails_counts: tuple[float, float] | None = None,
    linearity_limit: float = 0.01,
    hysteresis_limit: float = 0.01,
    drift_limit: float = 0.005,
) -> TorqueResult:
    """Fit the line through the steps' mean readings, each step one piece of evidence.

    Args:
        steps: In the order they were made: up through the levels and down again.
        rails_counts: Least and greatest count of the converter.
        linearity_limit: Greatest departure from the line that passes, share of the span.
        hysteresis_limit: Greatest hysteresis that passes, share of the span.
        drift_limit: Greatest drift of the zero that passes, share of the span.

    Raises:
        BadDataError: The data are not sufficient for a calibration; its `rule` is the reason.
    """
    check_points(len(steps), MINIMUM_STEPS, "steps")
    for k, step in enumerate(steps):
        readings = finite(step.counts, f"step {k + 1}")
        check_points(readings.size, MINIMUM_READINGS, f"readings in step {k + 1}")
        if rails_counts is not None:
            check_rails(readings, *rails_counts, f"the readings of step {k + 1}", pile_up=False)
        _check_steady(readings, f"step {k + 1}")
    torques = finite([step.torque_n_m for step in steps], "the torques")
    counts = np.array([step.counts.mean() for step in steps])
    noise = float(np.median([step.counts.std(ddof=1) for step in steps]))
    check_change(torques, 1e-9, "The torque")
    check_levels(torques, MINIMUM_LEVELS, "The torque")
    check_change(counts, max(10 * noise, 10.0), "The mean reading")

    # the readings carry the error: fitted over the torques, then the line is turned round
    line = stats.linregress(torques, counts)
    if float(line.slope) == 0.0:
        raise BadDataError("no_change", "The readings do not follow the torque at all.")
    slope, zero = 1.0 / float(line.slope), float(line.intercept)
    residual = (counts - zero) * slope - torques
    span = float(np.ptp(torques))
    linearity = _linearity(torques, residual) / span
    hysteresis, drift = _hysteresis(torques, residual), _zero_drift(torques, residual)
    hysteresis = None if hysteresis is None else hysteresis / span
    drift = None if drift is None else drift / span
    if drift is not None:
        fix = "Let the amplifier warm up, and repeat."
        check_limit("drift", abs(drift), drift_limit, "Drift of the zero", fix)
    if hysteresis is not None:
        fix = "Look for friction in the arm and for a loose mounting."
        check_limit("hysteresis", hysteresis, hysteresis_limit, "Hysteresis", fix)
    fix = "Check the masses, and that the arm stays level."
    check_limit("not_linear", linearity, linearity_limit, "The departure from a line", fix)
    return TorqueResult(
        slope_n_m=slope,
        zero_counts=zero,
        covariance=_covariance(torques, counts, float(line.slope), zero),
        residual_rms_n_m=float(np.sqrt(np.mean(residual**2))),
        linearity=linearity,
        hysteresis=hysteresis,
        drift=drift,
        low_counts=float(counts.min()),
        high_counts=float(counts.max()),
        steps=len(steps),
    )


def _check_steady(readings: FloatArray, name: str) -> None:
    """Refuse readings whose halves differ by more than the noise of one reading, and a count."""
    first, last = np.array_split(readings, 2)
    moved = abs(float(last.mean() - first.mean()))
    if moved > max(float(np.std(np.diff(readings))) / np.sqrt(2), 1.0):
        raise BadDataError(
            "not_steady",
            f"{name}: the reading moves by {moved:.4g} counts while it should rest.",
            "That is more than the noise of one reading.",
            "Wait until the weight hangs still.",
        )


def _linearity(torques: FloatArray, residual: FloatArray) -> float:
    return max(abs(float(residual[torques == level].mean())) for level in np.unique(torques))


def _hysteresis(torques: FloatArray, residual: FloatArray) -> float | None:
    """Return the greatest difference between a level reached from below and from above."""
    rising = np.diff(torques, prepend=torques[0]) > 0
    falling = np.diff(torques, prepend=torques[0]) < 0
    apart = [
        abs(float(residual[here & rising].mean() - residual[here & falling].mean()))
        for here in (torques == level for level in np.unique(torques))
        if (here & rising).any() and (here & falling).any()
    ]
    return max(apart, default=None)


def _zero_drift(torques: FloatArray, residual: FloatArray) -> float | None:
    if torques[0] != 0.0 or torques[-1] != 0.0:
        return None
    return float(residual[-1] - residual[0])


def _covariance(
    torques: FloatArray, counts: FloatArray, counts_per_n_m: float, zero: float
) -> tuple[tuple[float, ...], ...]:
    """Return the covariance of slope (N m a count) and zero, from that of counts over torque."""
    design = np.column_stack([torques, np.ones_like(torques)])
    residual = counts - design @ [counts_per_n_m, zero]
    variance = float(residual @ residual) / (len(torques) - 2)
    turned = np.diag([-1.0 / counts_per_n_m**2, 1.0])
    covariance = turned @ (variance * np.linalg.inv(design.T @ design)) @ turned
    return tuple(map(tuple, covariance.tolist()))
