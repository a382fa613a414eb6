"""The gear's twist against the torque it carries: stiffness and backlash.

    m / N - s = (T - T0) / k + (b / 2) sgn(T - T0) + c

m the motor's angle, s the spindle's, T the torque at the spindle, b the backlash. Loads of both
signs are needed: a gear that always leans to one side shows no gap. T0 is the reading at which the
gear carries nothing. A tare does not give it, since at rest friction holds some torque; the reading
at which the gap is crossed does, so it is searched for.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibration.chain import GEAR
from calibration.linear import CalibrationSet
from calibration.procedure import Conclusion, Measurement, Residuals, Result, Step
from calibration.quality import BadDataError, check_change
from calibration.record import Fit
from calibration.regression import Regression, is_better, refuse_drift, regress
from calibration.sessions.motion import condition, joined, moves, residuals, steady
from estimation.recording import FloatArray

TORQUE, MOTOR, SPINDLE = GEAR.torque, GEAR.reference, GEAR.channel
LEAST_TORQUE_N_M = 0.02
"""Below this torque the gear may be anywhere in its backlash, and the sample is excluded."""

ZEROS_N_M = np.arange(-0.06, 0.0601, 0.002)
"""Readings of an unloaded gear that are tried."""

Twist = tuple[FloatArray, FloatArray]
"""One run's torque, N m, and twist, rad, each of shape (n,)."""


@dataclass(frozen=True, kw_only=True)
class GearboxSession:
    """Calibrate the gear's twist."""

    loads_a: tuple[float, ...] = (-0.9, -0.5, 0.5, 0.9)  # loads of both signs
    speeds_rad_s: tuple[float, ...] = (0.5, 0.7)  # speeds of the spindle
    repeats: int = 1  # number of moves of each
    gear_ratio: float = GEAR.ratio  # motor turns a turn of the spindle
    stiffness_only: bool = False  # model no backlash

    kind = "gearbox"
    devices = ("logger",)

    def steps(self) -> list[Step]:
        """One move a load, speed and repeat."""
        return moves(self.speeds_rad_s, self.loads_a, self.repeats)

    def conclude(self, measurements: Sequence[Measurement], lines: CalibrationSet) -> Conclusion:
        """Return stiffness and backlash."""
        loads = condition(measurements, "load_command_a")
        if not (min(loads) < 0 < max(loads)):
            raise _one_sided(f"The loads go from {min(loads):g} to {max(loads):g} A.")
        runs = [steady(m, (TORQUE, MOTOR, SPINDLE)) for m in measurements]
        twists = [(run[TORQUE], run[MOTOR] / self.gear_ratio - run[SPINDLE]) for run in runs]
        every = joined(runs, TORQUE)
        check_change(every, 0.05, "The torque")
        zero_n_m, whole, without = _best_zero(twists)
        _refuse_no_slope(whole.values[0], whole.residual_rms, every)
        drift = refuse_drift(whole, float(np.ptp(every)) * abs(float(whole.values[0])))
        is_wide = abs(whole.values[1]) > whole.half_widths()[1]
        has_gap = is_wide and is_better(whole.held_out, without.held_out)
        used = without if self.stiffness_only else whole
        fit = _as_fit(used, int(every.size))
        found: dict[str, float | str] = {
            "backlash": f"{'' if has_gap else 'not '}significant on runs left out",
            "drift_ratio": drift,
            "backlash_ci95_rad": float(2 * whole.half_widths()[1]),
            "torque_zero_n_m": zero_n_m if has_gap else "only a gap shows it",
            "stiffness_without_backlash_n_m_rad": float(1.0 / without.values[0]),
        }
        carried = [torque[_carries(torque, zero_n_m)] for torque, _ in twists]
        series = residuals(measurements, carried, used)
        result = Result("gear_twist_rad", TORQUE, fit, float(every.min()), float(every.max()))
        return Conclusion((result,), found, Residuals("torque, N m", "residual, mrad", series))


def _as_fit(found: Regression, points: int) -> Fit:
    """Return stiffness, backlash where it was fitted, and offset, with their covariance."""
    values = {"stiffness_n_m_rad": 1.0 / found.values[0]}
    slopes = [-1.0 / found.values[0] ** 2]
    if len(found.values) > 2:
        values["backlash_rad"] = 2.0 * found.values[1]
        slopes.append(2.0)
    values["offset_rad"] = found.values[-1]
    jacobian = np.diag([*slopes, 1.0])
    covariance = jacobian @ found.covariance @ jacobian.T
    parameters = {name: float(value) for name, value in values.items()}
    return Fit("gearbox", parameters, covariance, found.residual_rms, points)


def _carries(torque_n_m: FloatArray, zero_n_m: float) -> NDArray[np.bool_]:
    return np.asarray(np.abs(torque_n_m - zero_n_m) > LEAST_TORQUE_N_M)


def _best_zero(twists: Sequence[Twist]) -> tuple[float, Regression, Regression]:
    """Return the torque reading of an unloaded gear, and the fits with and without a gap."""
    found = {}
    for zero in ZEROS_N_M:
        runs, plain = [], []
        for torque, twist in twists:
            kept = _carries(torque, zero)
            carried = torque[kept] - zero
            columns = np.column_stack([carried, np.sign(carried), np.ones_like(carried)])
            runs.append((columns, twist[kept]))
            plain.append((columns[:, [0, 2]], twist[kept]))
        signs = np.concatenate([columns[:, 1] for columns, _ in runs])
        if abs(signs.mean()) < 0.99 and min(len(y) for _, y in runs) > 0:
            found[float(zero)] = (regress(runs), regress(plain))
    if not found:
        raise _one_sided("The gear carries torque of one sign only.")
    best = min(found, key=lambda zero: (round(found[zero][0].residual_rms, 7), abs(zero)))
    return best, *found[best]


def _one_sided(what: str) -> BadDataError:
    why = "Backlash shows only where the gear leans to both sides."
    return BadDataError("levels", what, why, "Load both ways: some loads of each sign.")


def _refuse_no_slope(compliance: float, residual_rad: float, torque_n_m: FloatArray) -> None:
    twist = compliance * float(np.ptp(torque_n_m))
    if twist < 2 * residual_rad:
        raise BadDataError(
            "no_change",
            f"The gear twists by {twist * 1e3:.3g} mrad over the whole range of torque.",
            f"That is less than twice the residual of the fit, {residual_rad * 1e3:.3g} mrad.",
            "Load more, and check the signs of both encoders and of the torque.",
        )
