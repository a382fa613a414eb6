"""The limits of the rig: trips, and the limits that the board checks, in its counts and ticks."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calibration.linear import CalibrationSet
from drivers.teensy.protocol import TOP, SafeState
from drivers.teensy.reference import Limits
from rig.configuration.config import Config
from rig.configuration.sections import PlausibilitySection, SafetySection
from rig.errors import SafetyTripError

TICK_S = 1e-3

JUMP_SPEEDS = 4
"""A motor's count that goes so many times its fastest way in one tick has jumped."""

SEEN_COUNTS = 2
"""Counts of the spindle that are a motion and not the edge of one count."""


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
    gear_ratio = config.plausibility.gear_ratio
    motor_step_rad = safety.motor_speed_rad_s * period_s
    target_step = size("spindle_angle_rad", motor_step_rad / gear_ratio) if gear_ratio else TOP
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
        max_target_step=min(TOP, 1 + target_step),
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


def loop_limits(
    believed: PlausibilitySection,
    calibrations: CalibrationSet,
    channels: dict[str, str],
    current_limit_a: float,
    tick_s: float,
) -> dict[str, Any]:
    """Return the limits of one motor's position loop: `drivers.teensy.profile.LOOP_LIMIT_NAMES`.

    The motor's jump is not among them. What the rig has no channel for is not limited. `channels`
    are the names of the channels `motor`, `followed`, `current` and `command`.
    """
    lines = {role: calibrations.channels.get(name) for role, name in channels.items()}
    motor, followed = lines["motor"], lines["followed"]
    current, command = lines["current"], lines["command"]
    limits: dict[str, Any] = {}
    if followed is not None:
        limits["max_following"] = round(abs(believed.following_rad / followed.slope))
        limits["following_ticks"] = max(1, round(believed.following_s / tick_s))
    if current is None:
        return limits
    if command is not None:
        full_a = 1e4 * command.slope * believed.command_full_scale_a
        limits["full_scale_current"] = round(full_a / current.slope)
        offset = believed.command_offset_a / current.slope + current.zero_counts
        limits["current_offset"] = round(offset)
        limits["max_current_error"] = round(abs(believed.current_window_a / current.slope))
        limits["current_ticks"] = max(1, round(believed.current_s / tick_s))
    if motor is not None:
        frozen_a = believed.frozen_current_a or current_limit_a / 2
        limits["frozen_current"] = round(abs(frozen_a / current.slope))
        limits["frozen_motion"] = math.ceil(abs(believed.frozen_motor_rad / motor.slope))
    return limits


def pair_limits(
    believed: PlausibilitySection, calibrations: CalibrationSet, tick_s: float
) -> dict[str, int]:
    """Return the limits between motor, spindle and jaw, as far as the rig has them."""
    lines = calibrations.channels
    limits: dict[str, int] = {}
    spindle, motor, jaw = (lines.get(f"{one}_angle_rad") for one in ("spindle", "motor", "jaw"))
    proximal, distal = (lines.get(f"{one}_torque_n_m") for one in ("proximal", "distal"))
    if spindle is None:
        return limits
    limits["spindle_per_turn"] = round(2 * math.pi / spindle.slope)
    limits["probe_within"] = round(abs(believed.probe_rad / spindle.slope))
    limits["probe_patience"] = round(1e3 * believed.probe_s_rad * abs(spindle.slope) / tick_s)
    limits["max_spindle_jump"] = round(abs(believed.spindle_jump_rad / spindle.slope))
    if motor is not None and proximal is not None and believed.gear_ratio:
        motor_slope = motor.slope / believed.gear_ratio  # spindle angle a motor count
        limits["motor_per_turn"] = round(2 * math.pi / motor_slope)
        twist = proximal.slope / believed.gear_stiffness_n_m_rad / motor_slope
        limits["twist_e6"] = round(1e6 * twist)
        limits["max_twist"] = round(abs(believed.twist_window_rad / motor_slope))
    current = lines.get("motor_current_a")
    if current is not None and proximal is not None and motor is not None:
        made = believed.torque_constant_n_m_a * current.slope / proximal.slope
        limits["torque_e3"] = round(1e3 * made)
        limits["max_still_torque"] = round(abs(believed.still_torque_n_m / proximal.slope))
        seen_n_m = believed.gear_stiffness_n_m_rad * SEEN_COUNTS * abs(spindle.slope)
        change_n_m = max(believed.still_change_n_m, seen_n_m)  # a stiff gearhead turns nothing
        limits["max_still_change"] = round(abs(change_n_m / proximal.slope))
        limits["max_still_rise"] = round(abs(believed.still_rise_n_m / proximal.slope))
    if jaw is not None and distal is not None and believed.jaw_ratio:
        limits["jaw_per_turn"] = round(2 * math.pi * believed.jaw_ratio / jaw.slope)
        stretch = -distal.slope / believed.cable_stiffness_n_m_rad / jaw.slope
        limits["stretch_e6"] = round(1e6 * stretch)
        limits["max_stretch"] = round(abs(believed.stretch_window_rad / jaw.slope))
        limits["max_jaw_jump"] = round(abs(believed.jaw_jump_rad / jaw.slope))
        limits["jaw_zero"] = round(believed.jaw_zero_rad / jaw.slope + jaw.zero_counts)
        limits["max_beyond"] = round(abs(believed.beyond_rad / spindle.slope))
    return limits


def jaw_ends_rad(
    believed: PlausibilitySection, spindle_limit_rad: float, distal_limit_n_m: float
) -> tuple[float, float]:
    """Return the jaw's ends that follow from the spindle's travel and the cable's stretch."""
    stretch_rad = distal_limit_n_m / believed.cable_stiffness_n_m_rad + believed.stretch_window_rad
    reach = believed.jaw_ratio * spindle_limit_rad + stretch_rad
    return believed.jaw_zero_rad - reach, believed.jaw_zero_rad + reach


def choices(safety: SafetySection, tick_s: float) -> dict[str, Any]:
    """Return how long what may last, and the safe state, the same for every machine."""
    lasting = ("stall", "saturated", "stale", "dry", "hold")
    return {
        **{f"{name}_ticks": ticks_of(getattr(safety, f"{name}_s"), tick_s) for name in lasting},
        "watchdog_us": round(safety.watchdog_s * 1e6),
        "safe_state": SafeState[safety.safe_state.upper()],
        "hold_command_e4": round(safety.hold_command_ratio * 1e4),
    }


def ticks_of(duration_s: float, tick_s: float) -> int:
    """Return how many samples may be so on end; 0 s is for ever."""
    return max(1, round(duration_s / tick_s)) if duration_s else TOP


def check_samples(
    limits: Mapping[str, float],
    columns: Mapping[str, NDArray[np.float64]],
    time_s: NDArray[np.float64],
) -> None:
    """Hold every limit against every sample, armed or not; what is not a number is beyond it.

    A limit is the largest absolute value of a channel; one without a column is left out. `time_s`
    is the time of each sample in the session.

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
