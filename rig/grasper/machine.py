"""The 3-DOF grasper: three motors, one turns the yaw and two the jaws, each in a loop of its own.

Every motor's angle is that of its joint, closing positive: yaw, jaw 1 and jaw 2. A run asks for
yaw, pitch and grasp: pitch is the mean of the jaws' angles about their common axis, grasp the angle
between them, so jaw 1 turns by pitch + grasp / 2 and jaw 2 closes by grasp / 2 - pitch.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from calibration.linear import CalibrationSet
from drivers.teensy.grasper import GRASPER, AxisLimits, GrasperLimits
from drivers.teensy.profile import ArmLimits
from drivers.teensy.protocol import TOP, SafeState, Trip
from rig.configuration.config import Config
from rig.errors import UsageError
from rig.grasper.counts import GRASPER_COUNTS
from rig.machines.machine import FloatArray, MachinePlan
from rig.machines.plausible_counts import jump_limit, loop_limits
from rig.machines.safety import InCounts, check_setpoints, ticks_of
from rig.protocols import trajectory
from rig.protocols.joints import JointPlan
from rig.protocols.motion import RELAX_CYCLES, RELAX_HZ

AXES = ("yaw", "jaw_1", "jaw_2")
"""What motor 1, 2 and 3 turn."""
APPROACH_SPEED_RAD_S = 0.5
SHORTEST_MOVE_S = 0.5
RELAX_RAD = 0.03
"""Less than what is open before the jaws touch anything."""


@dataclass(frozen=True, eq=False)
class JointMotion:
    """Angles of the three axes over a whole motion, at 2 kHz.

    Attributes:
        setpoints: Yaw, jaw 1, jaw 2, each of shape (n,), rad.
        first: Index of the run's first setpoint.
        last: Index behind its last.
    """

    setpoints: tuple[FloatArray, ...]
    first: int
    last: int


def axes_of_joints(joint_rad: FloatArray) -> FloatArray:
    """Return the angles of yaw, jaw 1 and jaw 2 for yaw, pitch and grasp, both of shape (n, 3)."""
    yaw, pitch, grasp = joint_rad.T
    return np.stack([yaw, pitch + grasp / 2, grasp / 2 - pitch], axis=1)


class GrasperMachine:
    """Implements `rig.machines.machine.Machine`."""

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
    here_channels = tuple(f"{axis}_angle_rad" for axis in AXES)
    shown = ("grasp_force_n", "pitch_force_n", "yaw_force_n")

    @classmethod
    def of(cls, config: Config) -> Self:
        """Return the machine, the same for every configuration."""
        return cls()

    def at(self, rate_hz: float) -> Self:
        """Return itself: its board has one rate."""
        return self

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
            current, motor = f"{axis}_current_a", f"{axis}_motor_angle_rad"
            angle = f"{axis}_angle_rad"
            low, high = counts.ends(angle, -given[angle], given[angle])
            force = f"{axis}_force_n"
            max_motor_step = counts.size(motor, safety.motor_speed_rad_s * tick_s)
            loop = {
                "motor": motor,
                "followed": angle,
                "current": current,
                "command": f"{axis}_command_ratio",
            }
            return AxisLimits(
                max_current=counts.size(current, given[current]),
                max_force=counts.ends(force, None, given[force])[1],
                min_motor=low,
                max_motor=high,
                max_motor_step=max_motor_step,
                max_motor_jump=jump_limit(max_motor_step),
                max_target_step=min(TOP, max_motor_step + 1),
                continuous_current=counts.size(current, safety.continuous_current_a),
                i2t=counts.heat(current, safety.heat_a2_s),
                stall_current=counts.size(current, safety.stall_current_a),
                stall_motion=counts.size(motor, safety.stall_motor_angle_rad),
                **loop_limits(config.plausibility, calibrations, loop, given[current], tick_s),
            )

        yaw, jaw_1, jaw_2 = (axis_limits(axis) for axis in AXES)
        return GrasperLimits(
            (yaw, jaw_1, jaw_2),
            stall_ticks=ticks_of(safety.stall_s, tick_s),
            saturated_ticks=ticks_of(safety.saturated_s, tick_s),
            stale_ticks=ticks_of(safety.stale_s, tick_s),
            dry_ticks=ticks_of(safety.dry_s, tick_s),
            hold_ticks=ticks_of(safety.hold_s, tick_s),
            watchdog_us=round(safety.watchdog_s * 1e6),
            safe_state=SafeState[safety.safe_state.upper()],
            hold_command_e4=round(safety.hold_command_ratio * 1e4),
        )

    def reference_counts(
        self, config: Config, calibrations: CalibrationSet, here: Sequence[float]
    ) -> tuple[int, ...]:
        """Return the counts of the three motors."""
        lines = [calibrations.channels[f"{axis}_angle_rad"] for axis in AXES]
        return tuple(
            round(angle / line.slope + line.zero_counts)
            for angle, line in zip(here, lines, strict=True)
        )

    def check_setpoints(self, config: Config, setpoints: Sequence[FloatArray]) -> None:
        """Hold the limits of every motor's travel against a trajectory."""
        given = config.limits.model_dump()
        names = [f"{axis}_angle_rad" for axis in AXES]
        check_setpoints(
            (name, values, given[name]) for name, values in zip(names, setpoints, strict=True)
        )

    def here(self, columns: Mapping[str, FloatArray]) -> tuple[float, ...]:
        """Return where each motor stands."""
        return tuple(float(columns[f"{axis}_angle_rad"][-1]) for axis in AXES)

    def motion(self, plan: MachinePlan, here: tuple[float, ...]) -> JointMotion:
        """Return approach, run and the way back to where nothing is touched."""
        if not isinstance(plan, JointPlan):
            raise UsageError(
                f"The run {plan.name} moves a spindle.",
                "This rig is a grasper with three motors.",
                "Choose a protocol for it, such as grasper.",
            )
        run = axes_of_joints(plan.joint_rad)
        approach = _move(np.array(here), run[0])
        parts = [approach, run, _move(run[-1], run[0]), _relaxation(run[0])]
        first = len(approach)
        whole = np.concatenate(parts)
        return JointMotion(tuple(whole.T), first, first + len(run))

    def settling(self, here: tuple[float, ...]) -> JointMotion:
        """Return a little motion of every motor about where it stands."""
        whole = _relaxation(np.array(here))
        return JointMotion(tuple(whole.T), 0, len(whole))

    def too_narrow(self, limits: ArmLimits, sample: np.void) -> tuple[ArmLimits, Trip]:
        """Return limits whose travel of the last motor begins beyond where it stands."""
        assert isinstance(limits, GrasperLimits)  # noqa: S101
        here = int(sample["motor_3"])
        last = dataclasses.replace(limits.axes[2], min_motor=here + 100, max_motor=here + 200)
        narrow = dataclasses.replace(limits, axes=(*limits.axes[:2], last))
        return narrow, Trip.MOTOR_TRAVEL

    def beyond(self, limits: ArmLimits) -> tuple[NDArray[np.integer], ...]:
        """Return targets of which that of the last motor is beyond its travel."""
        assert isinstance(limits, GrasperLimits)  # noqa: S101
        return np.array([0]), np.array([0]), np.array([limits.axes[2].max_motor + 1])

    def untroubled(self, limits: ArmLimits) -> ArmLimits:
        """Return the limits without forces, and sensors that may be idle."""
        assert isinstance(limits, GrasperLimits)  # noqa: S101
        one, two, three = (dataclasses.replace(axis, max_force=TOP) for axis in limits.axes)
        return dataclasses.replace(limits, axes=(one, two, three), stale_ticks=TOP)


def _move(start_rad: FloatArray, stop_rad: FloatArray) -> FloatArray:
    """Return a move of all axes that ends for all at once, shape (n, 3)."""
    farthest = float(np.abs(stop_rad - start_rad).max())
    duration_s = max(farthest / APPROACH_SPEED_RAD_S, SHORTEST_MOVE_S)
    there = trajectory.minimum_jerk(0.0, 1.0, duration_s, GRASPER.rate_hz)
    move: FloatArray = start_rad + there[:, None] * (stop_rad - start_rad)
    return move


def _relaxation(centre_rad: FloatArray) -> FloatArray:
    swing = trajectory.relaxation(0.0, RELAX_RAD, RELAX_HZ, RELAX_CYCLES, GRASPER.rate_hz)
    return centre_rad + swing[:, None]
