"""The limits of the rig: what is refused, what trips, and what the board is told to hold itself."""

import numpy as np
from numpy.typing import NDArray

from calibration.linear import CalibrationSet
from drivers.teensy.protocol import STATUS_LIMIT_TRIPPED, STATUS_WATCHDOG_TRIPPED, Limits
from rig.config import LimitsSection
from rig.errors import SafetyTripError
from rig.reading import Reading


def board_limits(limits: LimitsSection, calibrations: CalibrationSet) -> Limits:
    """Return the limits the board holds against every sample itself, in its own counts."""

    def size(channel: str, value: float) -> int:
        return round(abs(value / calibrations.channels[channel].slope))

    line = calibrations.channels["spindle_angle_rad"]
    ends = [round(s * limits.spindle_angle_rad / line.slope + line.zero_counts) for s in (-1, 1)]
    return Limits(
        max_current=size("motor_current_a", limits.motor_current_a),
        max_load_ma=size("load_command_a", limits.load_command_a),
        max_proximal=size("proximal_torque_n_m", limits.proximal_torque_n_m),
        max_distal=size("distal_torque_n_m", limits.distal_torque_n_m),
        min_spindle=min(ends),
        max_spindle=max(ends),
    )


def check_setpoints(
    limits: LimitsSection,
    target_angle_rad: NDArray[np.float64],
    load_command_a: NDArray[np.float64],
) -> None:
    """Refuse a trajectory that the limits forbid, before anything moves.

    Raises:
        SafetyTripError: A setpoint is beyond its limit or not finite.
    """
    for name, values, limit in (
        ("spindle_angle_rad", target_angle_rad, limits.spindle_angle_rad),
        ("load_command_a", load_command_a, limits.load_command_a),
    ):
        if not np.isfinite(values).all() or np.abs(values).max(initial=0.0) > limit:
            raise SafetyTripError(
                f"The trajectory asks for {name} = {np.abs(values).max():.3g}.",
                f"The configured limit is {limit:g}; nothing was moved.",
                f"Change the protocol, or [limits] {name} if the rig can take it.",
            )


def check_samples(limits: LimitsSection, reading: Reading) -> None:
    """Hold every limit against every sample.

    Raises:
        SafetyTripError: A value is beyond its limit. The caller disarms the rig.
    """
    for name, limit in limits.model_dump().items():
        values = reading.columns.get(name)
        if values is None or values.size == 0:
            continue
        worst = int(np.abs(values).argmax())
        if abs(values[worst]) > limit:
            raise SafetyTripError(
                f"{name} reached {abs(values[worst]):.3g}, the limit is {limit:g}.",
                f"At {reading.time_s[worst]:.3f} s of the session; the rig is being disarmed.",
                "Find out what the jaw met before going on; limits stand under [limits].",
            )


def check_board(reading: Reading) -> None:
    """Look for what the board itself tripped over.

    Raises:
        SafetyTripError: Its watchdog or one of its limits tripped; it is in its safe state.
    """
    status = int(np.bitwise_or.reduce(reading.counts["status"]))
    fix = "The rig is in its safe state until it is armed again."
    if status & STATUS_LIMIT_TRIPPED:
        raise SafetyTripError("The logger tripped one of its own limits.", "", fix)
    if status & STATUS_WATCHDOG_TRIPPED:
        why = "It heard nothing from this computer for 250 ms while armed."
        raise SafetyTripError("The logger's watchdog tripped.", why, fix)
