"""The reference rig: a drive motor turns the spindle, a load motor works against the jaw."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Self

import numpy as np
from numpy.typing import NDArray

from calibration.linear import CalibrationSet
from drivers.teensy.profile import ArmLimits
from drivers.teensy.protocol import TOP, Trip
from drivers.teensy.reference import REFERENCE, Limits
from rig.configuration.config import Config
from rig.errors import UsageError
from rig.log.streams import COUNTS_STREAM
from rig.machines.machine import FloatArray, MachinePlan
from rig.machines.safety import board_limits, check_setpoints
from rig.protocols.motion import Motion, motion_of, settling
from rig.protocols.protocol import RunPlan


class ReferenceMachine:
    """Implements `rig.machines.machine.Machine`."""

    profile = REFERENCE
    counts = COUNTS_STREAM
    setpoint_channels = ("target_angle_rad", "load_command_a")
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
    board_limits = staticmethod(board_limits)

    @classmethod
    def of(cls, config: Config) -> Self:
        """Return the machine, the same for every configuration."""
        return cls()

    def at(self, rate_hz: float) -> Self:
        """Return itself: its board has one rate."""
        return self

    def first_look(self, config: Config) -> str:
        """Return the quick protocol, without load if the rig lacks a load motor."""
        return "quick" if config.reference_limits.load_command_a else "unloaded"

    def gains(self, config: Config) -> Sequence[float]:
        """Return the gains of the position controller."""
        return config.controller.gains()

    def reference_counts(
        self, config: Config, calibrations: CalibrationSet, here: Sequence[float]
    ) -> tuple[int, ...]:
        """Return the counts of motor, spindle and jaw, of a train without slack."""
        believed, (spindle_rad,) = config.plausibility, here
        angles = {
            "motor_angle_rad": believed.gear_ratio * spindle_rad,
            "spindle_angle_rad": spindle_rad,
            "jaw_angle_rad": believed.jaw_zero_rad + believed.jaw_ratio * spindle_rad,
        }
        lines = calibrations.channels
        return tuple(
            round(angle / lines[name].slope + lines[name].zero_counts) if name in lines else 0
            for name, angle in angles.items()
        )

    def check_setpoints(self, config: Config, setpoints: Sequence[FloatArray]) -> None:
        """Hold the limits of travel and load against a trajectory."""
        limits = config.reference_limits
        asked = (
            ("spindle_angle_rad", limits.spindle_angle_rad),
            (
                "load_command_a",
                limits.load_command_a,
            ),
        )
        check_setpoints(
            (name, values, limit) for (name, limit), values in zip(asked, setpoints, strict=True)
        )

    def here(self, columns: Mapping[str, FloatArray]) -> tuple[float, ...]:
        """Return where the spindle stands."""
        return (float(columns["spindle_angle_rad"][-1]),)

    def motion(self, plan: MachinePlan, here: tuple[float, ...]) -> Motion:
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
