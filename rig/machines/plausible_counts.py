"""The plausibility limits of a configuration in a board's counts and ticks."""

import math
from typing import Any

from calibration.linear import CalibrationSet
from rig.configuration.plausibility import PlausibilitySection

SEEN_COUNTS = 2
"""Counts of the spindle that are a motion and not the edge of one count."""


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
