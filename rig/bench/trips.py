"""What tripped or restarted, in words, how late, how to clear it; and the host's own watch."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from calibration.linear import CalibrationSet
from drivers.errors import DriverError
from drivers.link import wrapped_steps
from drivers.teensy import protocol
from drivers.teensy.core import CoreGuard, firmware_library
from drivers.teensy.driver import TeensyLogger
from drivers.teensy.profile import ArmLimits
from drivers.teensy.protocol import Trip, TripReport
from estimation.channels import unit_of
from rig.bench.sensor_logger import SensorLogger
from rig.errors import ExitCode, RigError, SafetyTripError
from rig.machines.machine import Machine
from rig.machines.reading import Reading, has_status

WORDS: dict[Trip, tuple[str, str]] = {
    Trip.HOST_SILENT: (
        "The board received nothing from this computer for too long",
        "Look for the load on this computer; [safety] watchdog_s sets the permitted time.",
    ),
    Trip.OVER_CURRENT: (
        "The motor current crossed its limit",
        "Find out what the motor works against; the limit is [limits] motor_current_a.",
    ),
    Trip.PROXIMAL_TORQUE: (
        "The torque at the spindle crossed its limit",
        "Find out what the jaw met; the limit is [limits] proximal_torque_n_m.",
    ),
    Trip.DISTAL_TORQUE: (
        "The torque at the jaw crossed its limit",
        "Find out what the jaw met; the limit is [limits] distal_torque_n_m.",
    ),
    Trip.SPINDLE_TRAVEL: (
        "The spindle went beyond its travel",
        "Turn it back by hand; the limit is [limits] spindle_angle_rad.",
    ),
    Trip.JAW_TRAVEL: (
        "The jaw went beyond its travel",
        "Move it back by hand; the limits are [safety] jaw_open_rad and jaw_closed_rad.",
    ),
    Trip.OVER_SPEED: (
        "The motor turned too fast",
        "Look for a broken cable or a load that let go; the limit is [safety] motor_speed_rad_s.",
    ),
    Trip.OVERHEATED: (
        "The motor current was too high for too long",
        "Let the motor cool; see [safety] continuous_current_a and heat_a2_s.",
    ),
    Trip.STALLED: (
        "The motor had current and did not move",
        "Look for what blocks the drive; see [safety] stall_current_a and stall_s.",
    ),
    Trip.SENSOR_SATURATED: (
        "A sensor stayed at the end of its range",
        "Check its wiring and amplifier, and that the load fits it; see [safety] saturated_s.",
    ),
    Trip.SENSOR_STALE: (
        "A sensor's reading stopped changing",
        "Check its wiring and supply; see [safety] stale_s.",
    ),
    Trip.MOTOR_TRAVEL: (
        "A motor went beyond its travel",
        "Turn it back by hand; the limits are [limits] ..._angle_rad.",
    ),
    Trip.OVER_FORCE: (
        "A force crossed its limit",
        "Find out what the jaw met; the limits are [limits] ..._force_n.",
    ),
    Trip.ENCODERS_DISAGREE: (
        "Two encoders on one drive train disagree by more than backlash and twist",
        "Check the encoder cables and couplings; see [plausibility] twist_window_rad,"
        " stretch_window_rad and beyond_rad.",
    ),
    Trip.FOLLOWING_ERROR: (
        "The motion stayed too far behind its target",
        "Look for what blocks the drive or lets it slip. A motor whose winding is hot has less"
        " torque at the same current: let it cool; see [plausibility] following_rad.",
    ),
    Trip.CURRENT_MISMATCH: (
        "The measured current is not the commanded one",
        "Check the read-back's wiring and the motor controller's scaling; see [plausibility]"
        " current_window_a.",
    ),
    Trip.ENCODER_JUMP: (
        "An encoder's count jumped farther than the shaft can turn",
        "Check its cable and shielding, then reference the rig again.",
    ),
    Trip.ENCODER_FROZEN: (
        "Current or torque changed and no encoder moved",
        "Check the encoders' cables and supply; see [plausibility] frozen_current_a and still_...",
    ),
    Trip.QUEUE_RAN_DRY: (
        "The board was kept alive and given no further setpoint",
        "Look for what held up this program; [safety] dry_s sets the permitted time.",
    ),
    Trip.EMERGENCY_STOP: (
        "The emergency stop was pressed, or its wire is broken",
        "Release it when the rig is safe.",
    ),
    Trip.SENSOR_MISSING: ("A sensor gave no reading", "Check its wiring and supply."),
}
"""What each trip is, and what to do before it is cleared."""

_IN_UNITS = (
    *(Trip.OVER_CURRENT, Trip.PROXIMAL_TORQUE, Trip.DISTAL_TORQUE),
    *(Trip.SPINDLE_TRAVEL, Trip.JAW_TRAVEL, Trip.MOTOR_TRAVEL, Trip.OVER_FORCE),
)
"""Trips whose value and limit are counts of their channel."""


def trip_error(
    report: TripReport, calibrations: CalibrationSet, state: str, machine: Machine
) -> SafetyTripError:
    """Return the error of a trip: what, how far and how late, and how to clear it."""
    what, fix = WORDS[report.code]
    details = [f"code {int(report.code)}"]
    if report.channel:
        details.append(_numbers(report, calibrations, machine))
    details.append(f"{report.late_us / 1000:g} ms after it began")
    return SafetyTripError(f"{what} ({', '.join(details)}).", state, f"{fix} Then run: rig clear")


def _numbers(report: TripReport, calibrations: CalibrationSet, machine: Machine) -> str:
    name = machine.channels_of_inputs[report.channel]
    line = calibrations.channels.get(name)
    if line is None or report.code not in _IN_UNITS:
        return f"{report.channel} at {report.value} counts"
    unit = unit_of(name)
    zero = line.zero_counts if report.code is Trip.OVER_FORCE else 0.0
    value, limit = (abs((count - zero) * line.slope) for count in (report.value, report.limit))
    return f"{name} = {value:.3g} {unit}, limit {limit:.3g} {unit}"


def tripped(reading: Reading) -> tuple[Trip, bool] | None:
    """Return the crossed limit and whether the board holds, None without a trip."""
    newest = int(reading.counts["status"][-1])
    if not newest & (protocol.STATUS_LIMIT_TRIPPED | protocol.STATUS_WATCHDOG_TRIPPED):
        return None
    return Trip(newest >> protocol.TRIP_SHIFT), bool(newest & protocol.STATUS_HOLDING)


class HostWatch:
    """The board's guards once more, on the samples as they arrived: the compiled core's own.

    It has the gains and limits that the board was armed with. Without the compiled core this
    computer holds `[limits]` alone.
    """

    def __init__(self, gains: Sequence[Any], limits: ArmLimits, machine: Machine) -> None:
        self._machine = machine
        is_built = firmware_library() is not None
        self._guard = CoreGuard(machine.profile, gains, limits) if is_built else None
        self._newest_us: int | None = None

    def check(self, reading: Reading) -> TripReport | None:
        """Return the first crossing in the armed samples, None when there is none."""
        armed = has_status(reading.counts["status"], protocol.STATUS_ARMED)
        if self._guard is None or not armed.any():
            return None
        samples = reading.counts[armed]
        names = self._machine.profile.input_names
        rows = np.stack([samples[name].astype(np.int32) for name in names], axis=1)
        before = int(samples["tick_us"][0]) if self._newest_us is None else self._newest_us
        self._newest_us = int(samples["tick_us"][-1])
        ticks = wrapped_steps(samples["tick_us"], before) / self._machine.profile.tick_us
        row, code, channel, value, limit, late_us = self._guard.first_crossing(rows, ticks)
        if code == Trip.NONE:
            return None
        tick_us = int(samples["tick_us"][row])
        named = names + self._machine.profile.further_names
        return TripReport(Trip(code), named[channel], value, limit, tick_us, late_us)


class BoardResetError(RigError):
    """The board was restarted while the session ran."""

    exit_code = ExitCode.DEVICE


def require_same_start(logger: TeensyLogger | SensorLogger, boot: int) -> None:
    """Compare the board's present start number with that of the session's beginning.

    A board that does not answer is left to the caller to report.

    Raises:
        BoardResetError: The numbers differ.
    """
    try:
        present = logger.identify().boot
    except DriverError:
        return
    if present != boot:
        raise BoardResetError(
            "The board was restarted while it was in use.",
            f"Its start number is {present} and was {boot} when the session began. The cause is a"
            " reset, its watchdog, or its supply.",
            "It is disarmed and its counts have lost their zeros. Find the cause of the restart,"
            " then run: rig reference",
        )
