"""From a planned run to everything the rig does for it: approach, the run, release."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rig.protocols import trajectory
from rig.protocols.protocol import RunPlan

APPROACH_SPEED_RAD_S = 0.8
LOAD_RAMP_S = 0.5

RELAX_RAD = 0.15
RELAX_HZ = 4.0
RELAX_CYCLES = 12


@dataclass(frozen=True, eq=False)
class Motion:
    """Setpoints of a whole motion: approach, the run, release.

    Attributes:
        setpoints: One array of shape (n,) for each field of a setpoint, closing-positive, SI units.
        first: Index of the run's first setpoint.
        last: Index behind its last.
    """

    setpoints: tuple[NDArray[np.float64], ...]
    first: int
    last: int


def motion_of(plan: RunPlan, here_rad: float) -> Motion:
    """Return the motion of spindle and load motor at 1 kHz that makes a run.

    Args:
        plan: The run.
        here_rad: Where the spindle stands, rad.
    """
    angle, load = plan.target_angle_rad, plan.load_command_a
    start = float(angle[0])
    approach = _move(here_rad, start)
    load_up = trajectory.minimum_jerk(0.0, float(load[0]), LOAD_RAMP_S)
    retreat = _move(float(angle[-1]), start)
    load_down = trajectory.minimum_jerk(float(load[-1]), 0.0, LOAD_RAMP_S)
    whole_angle = np.concatenate([approach, angle, retreat, _relaxation(start)])
    loads = np.concatenate([_hold(load_up, approach.size), load, load_down])
    first = approach.size
    setpoints = whole_angle, _hold(loads, whole_angle.size)
    return Motion(setpoints, first, first + angle.size)


def settling(here_rad: float) -> Motion:
    """Return the motion, without load, that lets friction give up the torque it holds.

    Played before the first zero: without it the zero holds whatever torque the last motion left
    locked in gear and cable, some 30 mN m at the spindle on the simulated rig.
    """
    angle = _relaxation(here_rad)
    return Motion((angle, np.zeros(angle.size)), 0, angle.size)


def _relaxation(centre_rad: float) -> NDArray[np.float64]:
    return trajectory.relaxation(centre_rad, RELAX_RAD, RELAX_HZ, RELAX_CYCLES)


def _move(start_rad: float, stop_rad: float) -> NDArray[np.float64]:
    duration_s = max(abs(stop_rad - start_rad) / APPROACH_SPEED_RAD_S, LOAD_RAMP_S)
    return trajectory.minimum_jerk(start_rad, stop_rad, duration_s)


def _hold(values: NDArray[np.float64], size: int) -> NDArray[np.float64]:
    """Return values with the last one held up to a size."""
    return np.pad(values, (0, size - values.size), mode="edge")
