"""The limits of the rig: trips, and limits checked by the board itself."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calibration.linear import CalibrationSet
from drivers.teensy.protocol import TOP, SafeState
from drivers.teensy.reference import Limits
from rig.configuration.config import Config
from rig.configuration.sections import SafetySection
from rig.errors import SafetyTripError
from rig.machines.plausible_counts import jaw_ends_rad, loop_limits, pair_limits

TICK_S = 1e-3

JUMP_SPEEDS = 4
"""A motor's count that goes so many times its fastest way in one tick has jumped."""


@dataclass(frozen=True)
class InCounts:
    """Limits as the board holds them, in counts; a channel that the rig has not is not limited."""

    calibrations: CalibrationSet

    def size(self, channel: str, value: float) -> int:
        """Return a size in counts."""
        line = self.calibrations.channels.get(channel)
        return TOP if line is None else min(TOP, round(abs(value / line.slope)))

    def ends(self, channel: str, low: float | None, high: float | None) -> tuple[int, int]:
        """Return the lowest and the highest count; None for no end."""
        line = self.calibrations.channels.get(channel)
        if line is None:
            return -TOP - 1, TOP
        at = [
            round(value / line.slope + line.zero_counts) if value is not None else None
            for value in ((low, high) if line.slope > 0 else (high, low))
        ]
        return (-TOP - 1 if at[0] is None else at[0], TOP if at[1] is None else at[1])

    def heat(self, channel: str, heat_a2_s: float) -> int:
        """Return a heat in counts^2 s; 0 is not a limit."""
        line = self.calibrations.channels[channel]
        return min(TOP, round(heat_a2_s / line.slope**2)) if heat_a2_s else TOP


def board_limits(config: Config, calibrations: CalibrationSet, period_s: float = TICK_S) -> Limits:
    """Return the limits the board holds against every sample itself, in its own counts.

    A channel that the rig does not have is not limited. `period_s` is the time between two samples:
    the core judges a motion by the ticks that passed, and counts samples.
    """
    limits, safety = config.reference_limits, config.safety
    counts = InCounts(calibrations)
    size, ends = counts.size, counts.ends
    min_spindle, max_spindle = ends(
        "spindle_angle_rad", -limits.spindle_angle_rad, limits.spindle_angle_rad
    )
    open_rad, closed_rad = jaw_ends_rad(
        config.plausibility, limits.spindle_angle_rad, limits.distal_torque_n_m
    )
    min_jaw, max_jaw = ends(
        "jaw_angle_rad",
        open_rad if safety.jaw_open_rad is None else safety.jaw_open_rad,
        closed_rad if safety.jaw_closed_rad is None else safety.jaw_closed_rad,
    )
    load_a = safety.load_continuous_a or limits.load_command_a
    motor = motor_limits(
        config,
        calibrations,
        {
            "motor": "motor_angle_rad",
            "followed": "spindle_angle_rad",
            "current": "motor_current_a",
            "command": "motor_command_ratio",
        },
        limits.motor_current_a,
        (TICK_S, period_s),
    )
    return Limits(
        max_load_ma=size("load_command_a", limits.load_command_a),
        max_proximal=size("proximal_torque_n_m", limits.proximal_torque_n_m),
        max_distal=size("distal_torque_n_m", limits.distal_torque_n_m),
        min_spindle=min_spindle,
        max_spindle=max_spindle,
        min_jaw=min_jaw,
        max_jaw=max_jaw,
        continuous_load_ma=size("load_command_a", load_a),
        load_i2t=counts.heat("load_command_a", safety.load_heat_a2_s),
        max_target_step=target_step(
            size, safety.motor_speed_rad_s * period_s, config.plausibility.gear_ratio
        ),
        **motor,
        **pair_limits(config.plausibility, calibrations, period_s),
        **choices(safety, period_s),
    )


def motor_limits(
    config: Config,
    calibrations: CalibrationSet,
    channels: dict[str, str],
    max_current_a: float,
    ticks_s: tuple[float, float],
) -> dict[str, Any]:
    """Return the limits of one motor and of its position loop.

    `channels` are the names of the channels `motor`, `followed`, `current` and `command`; `ticks_s`
    is the period of a tick of the core, and of a sample.
    """
    safety, counts = config.safety, InCounts(calibrations)
    motor, current = channels["motor"], channels["current"]
    max_motor_step = counts.size(motor, safety.motor_speed_rad_s * ticks_s[0])
    return {
        "max_current": counts.size(current, max_current_a),
        "max_motor_step": max_motor_step,
        "max_motor_jump": min(TOP, JUMP_SPEEDS * max_motor_step),
        "continuous_current": counts.size(current, safety.continuous_current_a),
        "i2t": counts.heat(current, safety.heat_a2_s),
        "stall_current": counts.size(current, safety.stall_current_a),
        "stall_motion": counts.size(motor, safety.stall_motor_angle_rad),
        **loop_limits(config.plausibility, calibrations, channels, max_current_a, ticks_s[1]),
    }


def choices(safety: SafetySection, tick_s: float) -> dict[str, Any]:
    """Return how long what may last, and the safe state, the same for every machine."""
    lasting = ("stall", "saturated", "stale", "dry", "hold")
    return {
        **{f"{name}_ticks": ticks_of(getattr(safety, f"{name}_s"), tick_s) for name in lasting},
        "watchdog_us": round(safety.watchdog_s * 1e6),
        "safe_state": SafeState[safety.safe_state.upper()],
        "hold_command_e4": round(safety.hold_command_ratio * 1e4),
    }


def target_step(size: Callable[[str, float], int], motor_step_rad: float, gear_ratio: float) -> int:
    """Return how far one setpoint of the spindle may be from the next: at the motor's speed."""
    if not gear_ratio:
        return TOP
    return min(TOP, 1 + size("spindle_angle_rad", motor_step_rad / gear_ratio))


def ticks_of(duration_s: float, tick_s: float) -> int:
    """Return how many samples may be so on end; 0 s is for ever."""
    return max(1, round(duration_s / tick_s)) if duration_s else TOP


def check_samples(
    limits: Mapping[str, float],
    columns: Mapping[str, NDArray[np.float64]],
    time_s: NDArray[np.float64],
) -> None:
    """Hold every limit against every sample, armed or not; what is not a number is beyond it.

    Args:
        limits: Channel to its largest absolute value.
        columns: Values by channel; a limit whose channel is not among them is left out.
        time_s: Time of each sample in the session.

    Raises:
        SafetyTripError: A value is beyond its limit. The caller disarms the rig.
    """
    for name, limit in limits.items():
        values = columns.get(name)
        if values is None or values.size == 0:
            continue
        beyond = ~(np.abs(values) <= limit)  # NaN fails too
        if beyond.any():
            worst = int(beyond.argmax())
            raise SafetyTripError(
                f"{name} reached {abs(values[worst]):.3g}, the limit is {limit:g}.",
                f"At {time_s[worst]:.3f} s of the session; the rig is being disarmed.",
                "Find out what the jaw met before going on; limits stand under [limits].",
            )
