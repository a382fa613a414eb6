"""The limits of the rig: what is refused, what trips, and what the board is told to hold itself."""

import numpy as np
from numpy.typing import NDArray

from calibration.linear import CalibrationSet
from drivers.teensy.protocol import TOP, Limits, SafeState
from rig.config import Config, LimitsSection
from rig.errors import SafetyTripError
from rig.reading import Reading

TICK_S = 1e-3


def board_limits(config: Config, calibrations: CalibrationSet) -> Limits:
    """Return the limits the board holds against every sample itself, in its own counts.

    A channel that the rig does not have is not limited.
    """
    limits, safety = config.limits, config.safety
    lines = calibrations.channels

    def size(channel: str, value: float) -> int:
        return min(TOP, round(abs(value / lines[channel].slope))) if channel in lines else TOP

    def ends(channel: str, low: float | None, high: float | None) -> tuple[int, int]:
        if channel not in lines:
            return -TOP - 1, TOP
        line = lines[channel]
        at = [
            round(value / line.slope + line.zero_counts) if value is not None else None
            for value in ((low, high) if line.slope > 0 else (high, low))
        ]
        return (-TOP - 1 if at[0] is None else at[0], TOP if at[1] is None else at[1])

    min_spindle, max_spindle = ends(
        "spindle_angle_rad", -limits.spindle_angle_rad, limits.spindle_angle_rad
    )
    min_jaw, max_jaw = ends("jaw_angle_rad", safety.jaw_open_rad, safety.jaw_closed_rad)
    heat = safety.heat_a2_s / lines["motor_current_a"].slope ** 2
    return Limits(
        max_current=size("motor_current_a", limits.motor_current_a),
        max_load_ma=size("load_command_a", limits.load_command_a),
        max_proximal=size("proximal_torque_n_m", limits.proximal_torque_n_m),
        max_distal=size("distal_torque_n_m", limits.distal_torque_n_m),
        min_spindle=min_spindle,
        max_spindle=max_spindle,
        min_jaw=min_jaw,
        max_jaw=max_jaw,
        max_motor_step=size("motor_angle_rad", safety.motor_speed_rad_s * TICK_S),
        continuous_current=size("motor_current_a", safety.continuous_current_a),
        i2t=min(TOP, round(heat)) if safety.heat_a2_s else TOP,
        stall_current=size("motor_current_a", safety.stall_current_a),
        stall_motion=size("motor_angle_rad", safety.stall_motor_angle_rad),
        stall_ticks=_ticks(safety.stall_s),
        saturated_ticks=_ticks(safety.saturated_s),
        stale_ticks=_ticks(safety.stale_s),
        watchdog_us=round(safety.watchdog_s * 1e6),
        safe_state=SafeState[safety.safe_state.upper()],
        hold_command_e4=round(safety.hold_command_ratio * 1e4),
    )


def _ticks(duration_s: float) -> int:
    """Return how many samples may be so on end; 0 s is for ever."""
    return max(1, round(duration_s / TICK_S)) if duration_s else TOP


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
    """Hold every limit against every sample, armed or not; what is not a number is beyond it.

    Raises:
        SafetyTripError: A value is beyond its limit. The caller disarms the rig.
    """
    for name, limit in limits.model_dump().items():
        values = reading.columns.get(name)
        if values is None or values.size == 0:
            continue
        beyond = ~(np.abs(values) <= limit)  # NaN fails too
        if beyond.any():
            worst = int(beyond.argmax())
            raise SafetyTripError(
                f"{name} reached {abs(values[worst]):.3g}, the limit is {limit:g}.",
                f"At {reading.time_s[worst]:.3f} s of the session; the rig is being disarmed.",
                "Find out what the jaw met before going on; limits stand under [limits].",
            )
