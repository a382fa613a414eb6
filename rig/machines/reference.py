"""The reference rig: a drive motor turns the spindle, a load motor works against the jaw."""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from calibration.linear import CalibrationSet
from drivers.teensy.profile import ArmLimits, Profile
from drivers.teensy.protocol import TOP, Trip
from drivers.teensy.reference import REFERENCE, Limits
from rig.configuration.config import Config
from rig.errors import UsageError
from rig.machines.machine import Machine
from rig.machines.safety import board_limits
from rig.protocols.motion import Motion, motion_of, settling
from rig.protocols.protocol import Plan, RunPlan


class ReferenceMachine(Machine):
    """The reference rig."""

    profile: Profile = REFERENCE
    setpoint_channels = ("target_angle_rad", "load_command_a")
    setpoint_limits = ("spindle_angle_rad", "load_command_a")
    channels_of_inputs: Mapping[str, str] = {
        "motor": "motor_angle_rad",
        "spindle": "spindle_angle_rad",
        "jaw": "jaw_angle_rad",
        "proximal": "proximal_torque_n_m",
        "distal": "distal_torque_n_m",
        "current": "motor_current_a",
        "load_ma": "load_command_a",
    }
    here_channels = ("spindle_angle_rad",)
    shown: tuple[str, ...] = ("distal_torque_n_m",)

    def first_look(self, config: Config) -> str:
        """Return the quick protocol, without load if the rig lacks a load motor."""
        return "quick" if config.reference_limits.load_command_a else "unloaded"

    def gains(self, config: Config) -> Sequence[float]:
        """Return the gains of the position controller."""
        return config.controller.gains()

    def board_limits(self, config: Config, calibrations: CalibrationSet) -> Limits:
        """Return the limits at the rate of the samples."""
        return board_limits(config, calibrations, 1 / self.profile.rate_hz)

    def train_rad(self, config: Config, here: Sequence[float]) -> dict[str, float]:
        """Return the angles of motor, spindle and jaw."""
        believed, (spindle_rad,) = config.plausibility, here
        return {
            "motor_angle_rad": believed.gear_ratio * spindle_rad,
            "spindle_angle_rad": spindle_rad,
            "jaw_angle_rad": believed.jaw_zero_rad + believed.jaw_ratio * spindle_rad,
        }

    def motion(self, plan: Plan, here: tuple[float, ...]) -> Motion:
        """Return approach, run and release of the spindle."""
        if not isinstance(plan, RunPlan):
            raise UsageError(
                f"The run {plan.name} moves the joints of a grasper.",
                "This rig has a spindle.",
                "Choose a protocol for it, such as quick.",
            )
        return motion_of(plan, here[0])

    def settling(self, here: tuple[float, ...]) -> Motion:
        """Return a little motion of the unloaded spindle."""
        return settling(here[0])

    def too_narrow(self, limits: ArmLimits, sample: np.void) -> tuple[ArmLimits, Trip]:
        """Return limits whose travel begins beyond where the spindle stands."""
        assert isinstance(limits, Limits)  # noqa: S101
        here = int(sample["spindle"])
        narrow = dataclasses.replace(limits, min_spindle=here + 100, max_spindle=here + 200)
        return narrow, Trip.SPINDLE_TRAVEL

    def beyond(self, limits: ArmLimits) -> tuple[NDArray[np.integer], ...]:
        """Return a spindle target beyond the travel."""
        assert isinstance(limits, Limits)  # noqa: S101
        return np.array([limits.max_spindle + 1]), np.array([0])

    def untroubled(self, limits: ArmLimits) -> ArmLimits:
        """Return the limits without torques, and sensors that may be idle."""
        assert isinstance(limits, Limits)  # noqa: S101
        return dataclasses.replace(limits, max_proximal=TOP, max_distal=TOP, stale_ticks=TOP)
