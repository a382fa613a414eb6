"""Scales of torque and current sensors held against each other in recordings that exist.

The two torque sensors. Losses between spindle and jaw are never negative, so in steady motion

    dT_p/dT_d while opening  <=  dtheta_j/dtheta_s  <=  dT_p/dT_d while closing,

T_p and theta_s at the spindle, T_d and theta_j at the jaw. The slopes over the encoders' ratio are
an interval that holds the scale of one sensor against the other; friction makes it wide, and
nothing in a recording makes it narrower. Only weights do.

Motor current and the torque at the spindle: the slope of a calibration of the current
(`calibration.sessions.current`), which is the product of both scales and the drive's efficiency.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from calibration.agreement import LEAST_RUNS, fitted
from calibration.chain import CURRENT, PAIRS
from calibration.history import deviation
from calibration.procedure import Measurement
from calibration.quality import check_change
from calibration.record import CalibrationRecord
from calibration.regression import regress
from calibration.sessions.current import COMMAND, TORQUE, equation
from calibration.sessions.motion import steady
from estimation.recording import FloatArray, Recording

JAW_TORQUE = PAIRS["jaw"].torque
LEAST_CHANGE_N_M = 0.02
"""Change of the torque that a slope needs."""
SPAN = (2.5, 97.5)
"""Percentiles between which a sensor's usual span lies."""


@dataclass(frozen=True)
class Scale:
    """The scale of one sensor against another."""

    channel: str
    reference: str  # channel of the sensor it is compared with
    runs: int
    low: float  # least value that the recordings allow, 95 %
    high: float  # greatest
    unit: str  # unit of these
    expected: float | None  # what the calibrations say; None where there is none to compare with
    source: str  # where the expected value comes from
    span: float  # usual span of the reference, in its unit
    residual: float  # error of the fit, N m: twist, noise, and what the equation lacks

    @property
    def is_wrong(self) -> bool:
        """Whether the expected value is off by more than the interval and the residual explain."""
        if self.expected is None:
            return False
        error = max(self.low - self.expected, self.expected - self.high)
        return error > 0 and error * self.span > self.residual


def torque_scale(runs: Sequence[Recording]) -> Scale:
    """Return the scale of the torque sensor at the spindle against the one at the jaw.

    Raises:
        BadDataError: Too few runs with both sensors and both encoders, or the load does not change.
    """
    pair = PAIRS["jaw"]
    names = (TORQUE, JAW_TORQUE)
    needed = (*names, pair.channel, pair.reference)
    whole = [run for run in runs if all(name in run for name in needed)]
    ratios = [fit[0] * pair.nominal_ratio for run in whole if (fit := fitted(run, pair))]
    parts = [steady(Measurement(run), names) for run in whole]
    both = [
        regress([_slope(p, sign) for p in parts if (p["direction"] == sign).any()], LEAST_RUNS)
        for sign in (1.0, -1.0)
    ]
    loads = np.concatenate([p[JAW_TORQUE] for p in parts])
    check_change(loads, LEAST_CHANGE_N_M, "The torque at the jaw")
    ratio = float(np.median(ratios))
    slopes = [(fit.values[0], fit.half_widths()[0]) for fit in both]
    return Scale(
        channel=TORQUE,
        reference=JAW_TORQUE,
        runs=len(parts),
        low=float(min(value - half for value, half in slopes)) / ratio,
        high=float(max(value + half for value, half in slopes)) / ratio,
        unit="",
        expected=1.0,
        source="the encoders' ratio",
        span=_span(loads) * ratio,
        residual=max(fit.residual_rms for fit in both),
    )


def current_scale(runs: Sequence[Recording], record: CalibrationRecord | None) -> Scale:
    """Return the torque at the spindle that an ampere of the motor gives in runs of one rig.

    It is expected to be that of the record, the active calibration of kind `current`, if any.

    Raises:
        BadDataError: Too few runs with both sensors, or the load does not change.
    """
    names = (CURRENT, TORQUE, COMMAND)
    parts = [steady(Measurement(run), names) for run in runs if all(n in run for n in names)]
    fit = regress([equation(part) for part in parts], LEAST_RUNS)
    check_change(np.concatenate([p[TORQUE] for p in parts]), LEAST_CHANGE_N_M, "The torque")
    value, half = float(fit.values[0]), float(fit.half_widths()[0])
    expected, source = None, ""
    if record is not None:
        expected = float(record.fit.parameters["torque_constant_n_m_a"])
        half += 2.0 * (deviation(record, "torque_constant_n_m_a") or 0.0)
        source = f"record {record.content_hash} of {record.made_at[:10]}"
    span = _span(np.concatenate([p[CURRENT] for p in parts]))
    return Scale(
        channel=CURRENT,
        reference=TORQUE,
        runs=len(parts),
        low=value - half,
        high=value + half,
        unit="N m/A",
        expected=expected,
        source=source,
        span=span,
        residual=fit.residual_rms,
    )


def _slope(part: Mapping[str, FloatArray], direction: float) -> tuple[FloatArray, FloatArray]:
    """Return the equation of one direction: torque at the jaw, zero, speed."""
    used = part["direction"] == direction
    columns = [part[JAW_TORQUE], np.ones(len(used)), part["spindle_velocity_rad_s"]]
    return np.column_stack(columns)[used], part[TORQUE][used]


def _span(values: FloatArray) -> float:
    low, high = np.percentile(values, SPAN)
    return float(high - low)
