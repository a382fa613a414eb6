"""From a planned run to everything the rig does for it: approach, the run, release."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from estimation.recording import FloatArray
from rig.protocols import trajectory
from rig.protocols.protocol import RunPlan
from rig.protocols.trajectory import SAMPLE_RATE_HZ

APPROACH_SPEED_RAD_S = 0.8
LOAD_RAMP_S = SHORTEST_MOVE_S = 0.5

RELAX_RAD = 0.15
RELAX_HZ = 4.0
RELAX_CYCLES = 12
RELAX_DECAYS = 4.0
"""Time constants of a relaxation's decay."""


@dataclass(frozen=True, eq=False)
class Motion:
    """Setpoints of a whole motion: approach, the run, release."""

    # one array of shape (n,) for each field of a setpoint, closing-positive, SI units
    setpoints: tuple[FloatArray, ...]
    first: int  # index of the run's first setpoint
    last: int


def path_of(
    run_rad: FloatArray, here_rad: ArrayLike, rate_hz: float, speed_rad_s: float, relax_rad: float
) -> tuple[FloatArray, int]:
    """Return the approach, a run of shape (n, axes), the way back to its start and a relaxation.

    All axes arrive at once. The second value is the index of the run's first angle.
    """
    approach = _move(np.asarray(here_rad), run_rad[0], rate_hz, speed_rad_s)
    back = _move(run_rad[-1], run_rad[0], rate_hz, speed_rad_s)
    parts = [approach, run_rad, back, relaxed(run_rad[0], rate_hz, relax_rad)]
    return np.concatenate(parts), len(approach)


def relaxed(centre_rad: FloatArray, rate_hz: float, relax_rad: float) -> FloatArray:
    """Return an oscillation of every axis that dies out where it stands, shape (n, axes).

    Friction gives up the torque it holds. The amplitude decays exponentially to nothing, as in
    demagnetising: each reversal is a little smaller than the one before, so that what friction
    still holds at the end is small too.
    """
    t = trajectory.times(RELAX_CYCLES / RELAX_HZ, rate_hz)
    decay: FloatArray = np.exp(-RELAX_DECAYS * t / t[-1]) - np.exp(-RELAX_DECAYS)
    swing = relax_rad * decay * np.sin(2.0 * np.pi * RELAX_HZ * t)
    return np.asarray(centre_rad + swing[:, None])


def motion_of(plan: RunPlan, here_rad: float) -> Motion:
    """Return the motion of spindle and load motor at 1 kHz that makes a run from here."""
    run, load = plan.target_angle_rad[:, None], plan.load_command_a
    whole, first = path_of(run, [here_rad], SAMPLE_RATE_HZ, APPROACH_SPEED_RAD_S, RELAX_RAD)
    load_up = trajectory.minimum_jerk(0.0, float(load[0]), LOAD_RAMP_S)
    load_down = trajectory.minimum_jerk(float(load[-1]), 0.0, LOAD_RAMP_S)
    loads = np.concatenate([_hold(load_up, first), load, load_down])
    return Motion((whole[:, 0], _hold(loads, len(whole))), first, first + len(run))


def settling(here_rad: float) -> Motion:
    """Return the motion, without load, that lets friction give up the torque it holds.

    Played before the first zero: without it the zero holds whatever torque the last motion left
    locked in gear and cable, some 30 mN m at the spindle on the simulated rig.
    """
    angle = relaxed(np.array([here_rad]), SAMPLE_RATE_HZ, RELAX_RAD)[:, 0]
    return Motion((angle, np.zeros(angle.size)), 0, angle.size)


def _move(
    start_rad: FloatArray, stop_rad: FloatArray, rate_hz: float, speed_rad_s: float
) -> FloatArray:
    farthest = float(np.abs(stop_rad - start_rad).max())
    duration_s = max(farthest / speed_rad_s, SHORTEST_MOVE_S)
    there = trajectory.minimum_jerk(0.0, 1.0, duration_s, rate_hz)
    return np.asarray(start_rad + there[:, None] * (stop_rad - start_rad))


def _hold(values: FloatArray, size: int) -> FloatArray:
    """Return values with the last one held up to a size."""
    return np.pad(values, (0, size - values.size), mode="edge")
