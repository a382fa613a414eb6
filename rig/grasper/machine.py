"""The 3-DOF grasper: three motors, one turns the yaw and two the jaws, each in a loop of its own.

Every motor's angle is that of its joint, closing positive: yaw, jaw 1 and jaw 2. A run asks for
yaw, pitch and grasp: pitch is the mean of the jaws' angles about their common axis, grasp the angle
between them, so jaw 1 turns by pitch + grasp / 2 and jaw 2 closes by grasp / 2 - pitch.
"""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from calibration.linear import CalibrationSet
from drivers.teensy.grasper import GRASPER, AxisLimits, GrasperLimits
from drivers.teensy.profile import ArmLimits
from drivers.teensy.protocol import TOP, Trip
from estimation.recording import FloatArray
from rig.configuration.config import Config
from rig.errors import UsageError
from rig.log.schema import Field, Stream
from rig.log.streams import COUNTS
from rig.machines.machine import Machine
from rig.machines.safety import InCounts, choices, motor_limits
from rig.protocols.joints import JointPlan
from rig.protocols.motion import Motion, path_of, relaxed
from rig.protocols.protocol import Plan

AXES = ("yaw", "jaw_1", "jaw_2")
"""What motor 1, 2 and 3 turn."""
APPROACH_SPEED_RAD_S = 0.5
RELAX_RAD = 0.03
"""Less than what is open before the jaws touch anything."""

_MOTORS = ((1, "yaw"), (2, "jaw 1"), (3, "jaw 2"))

GRASPER_COUNTS = Stream(
    COUNTS,
    "rig_msgs/msg/GrasperCounts",
    (
        *(Field(f"motor_{k}", "int32", "", f"encoder of the motor of {a}") for k, a in _MOTORS),
        *(Field(f"target_{k}", "int32", "", f"target of {a}, counts") for k, a in _MOTORS),
        *(Field(f"current_{k}", "int32", "", f"measured current of {a}") for k, a in _MOTORS),
        *(Field(f"force_{k}", "int32", "", f"force sensor of {a}") for k, a in _MOTORS),
        *(
            Field(f"command_{k}_e4", "int32", "", f"command to {a}, 1e-4 of full")
            for k, a in _MOTORS
        ),
        Field("sequence", "uint32", "", "number of the sample since the stream began"),
        Field("tick_us", "uint32", "", "device clock as sent, wraps at 2^32"),
        Field("status", "uint32", "", "status bits of the logger"),
    ),
    GRASPER.rate_hz,
)
"""The grasper's raw counts; all rise on closing."""


def axes_of_joints(joint_rad: FloatArray) -> FloatArray:
    """Return the angles of yaw, jaw 1 and jaw 2 for yaw, pitch and grasp, both of shape (n, 3)."""
    yaw, pitch, grasp = joint_rad.T
    return np.stack([yaw, pitch + grasp / 2, grasp / 2 - pitch], axis=1)


class GrasperMachine(Machine):
    """The grasper."""

    profile = GRASPER
    counts = GRASPER_COUNTS
    setpoint_channels = tuple(f"{axis}_target_rad" for axis in AXES)
    channels_of_inputs: Mapping[str, str] = {
        f"{field}_{number}": f"{axis}_{channel}"
        for number, axis in enumerate(AXES, 1)
        for field, channel in (
            ("motor", "angle_rad"),
            ("current", "current_a"),
            ("force", "force_n"),
        )
    }
    setpoint_limits = here_channels = tuple(f"{axis}_angle_rad" for axis in AXES)
    shown = ("grasp_force_n", "pitch_force_n", "yaw_force_n")

    def first_look(self, config: Config) -> str:
        """Return the grasper's own protocol."""
        return "grasper"

    def gains(self, config: Config) -> Sequence[Sequence[float]]:
        """Return the same gains for every motor."""
        return [config.controller.gains()] * len(AXES)

    def board_limits(self, config: Config, calibrations: CalibrationSet) -> GrasperLimits:
        """Return every motor's limits in its own counts."""
        safety, tick_s = config.safety, GRASPER.tick_us * 1e-6
        given = config.limits.model_dump()
        counts = InCounts(calibrations)

        def axis_limits(axis: str) -> AxisLimits:
            current, angle, force = f"{axis}_current_a", f"{axis}_angle_rad", f"{axis}_force_n"
            low, high = counts.ends(angle, -given[angle], given[angle])
            channels = {
                "motor": f"{axis}_motor_angle_rad",
                "followed": angle,
                "current": current,
                "command": f"{axis}_command_ratio",
            }
            motor = motor_limits(config, calibrations, channels, given[current], (tick_s, tick_s))
            return AxisLimits(
                max_force=counts.ends(force, None, given[force])[1],
                min_motor=low,
                max_motor=high,
                max_target_step=min(TOP, motor["max_motor_step"] + 1),
                **motor,
            )

        yaw, jaw_1, jaw_2 = (axis_limits(axis) for axis in AXES)
        return GrasperLimits((yaw, jaw_1, jaw_2), **choices(safety, tick_s))

    def motion(self, plan: Plan, here: tuple[float, ...]) -> Motion:
        """Return approach, run and the way back to where nothing is touched."""
        if not isinstance(plan, JointPlan):
            raise UsageError(
                f"The run {plan.name} moves a spindle.",
                "This rig is a grasper with three motors.",
                "Choose a protocol for it, such as grasper.",
            )
        run = axes_of_joints(plan.joint_rad)
        whole, first = path_of(run, here, GRASPER.rate_hz, APPROACH_SPEED_RAD_S, RELAX_RAD)
        return Motion(tuple(whole.T), first, first + len(run))

    def settling(self, here: tuple[float, ...]) -> Motion:
        """Return a little motion of every motor about where it stands."""
        whole = relaxed(np.array(here), GRASPER.rate_hz, RELAX_RAD)
        return Motion(tuple(whole.T), 0, len(whole))

    def too_narrow(self, limits: ArmLimits, sample: np.void) -> tuple[ArmLimits, Trip]:
        """Return limits whose travel of the last motor begins beyond where it stands."""
        assert isinstance(limits, GrasperLimits)  # noqa: S101
        here = int(sample["motor_3"])
        last = dataclasses.replace(limits.axes[2], min_motor=here + 100, max_motor=here + 200)
        return dataclasses.replace(limits, axes=(*limits.axes[:2], last)), Trip.MOTOR_TRAVEL

    def beyond(self, limits: ArmLimits) -> tuple[NDArray[np.integer], ...]:
        """Return targets of which that of the last motor is beyond its travel."""
        assert isinstance(limits, GrasperLimits)  # noqa: S101
        return np.array([0]), np.array([0]), np.array([limits.axes[2].max_motor + 1])

    def untroubled(self, limits: ArmLimits) -> ArmLimits:
        """Return the limits without forces, and sensors that may be idle."""
        assert isinstance(limits, GrasperLimits)  # noqa: S101
        one, two, three = (dataclasses.replace(axis, max_force=TOP) for axis in limits.axes)
        return dataclasses.replace(limits, axes=(one, two, three), stale_ticks=TOP)
