"""The simulated 3-DOF grasper on the live display: grasp, pitch and yaw force from current."""

import numpy as np

from estimation.recording import FloatArray, Recording
from rig.grasper.coupling import Limits
from rig.grasper.current_force import CurrentForce
from rig.grasper.master import Master, Pot
from rig.grasper.three_dof import planetary_grasper
from rig.grasper.wrist import CablePath
from rig.live.replay import ESTIMATED
from rig.simulation.grasper_inputs import hold
from rig.simulation.grasper_plant import RATE_HZ, THIRD
from rig.studies.zhao_methods import axes_of, record

SLOPES = {"grasp": 1.28, "pitch": 1.31, "yaw": 1.55}
"""Slope of estimate over force in long steady grasps: the paper's, and for the pitch, whose
coefficient is missing in our copy, that of the simulated grasper."""

CHANNELS = tuple(f"{dof}_force_n" for dof in SLOPES)
PATH = CablePath(0.004, 0.004, 0.005, 0.01, 0.006, 0.008)
LIMITS = Limits.degrees((-80.0, 80.0), (-80.0, 80.0), (-60.0, 60.0))
HOLD_S, FORCE_N = 4.0, 1.5
JOINTS = ("yaw", "pitch", "grasp")
EVERY = 2


def master() -> Master:
    """Return the master with equal potentiometers and the paper's grasper."""
    return Master((Pot(), Pot(), Pot()), planetary_grasper(PATH, limits=LIMITS))


def master_session(seed: int = 0) -> Recording:
    """Return a session at the master, at 1 kHz: grasp, then pitch, then yaw, each held.

    The master's angles go through the potentiometers' counts to the motors' positions; each motor
    follows its own. Forces are measured and, from current by the paper's method, estimated.

    Args:
        seed: Seed of noise and hidden parameters.
    """
    chief = master()
    columns: dict[str, FloatArray] = {}
    for turn, dof in enumerate(SLOPES):
        axes = axes_of(THIRD, dof, seed, 0.1)
        asked = hold(axes[0], FORCE_N, HOLD_S)
        joints = np.zeros((asked.size * len(SLOPES), len(JOINTS)))
        joints[turn * asked.size : (turn + 1) * asked.size, JOINTS.index(dof)] = asked
        motors = chief.motor_rad(chief.counts(joints))
        reached = chief.grasper.joint_position(motors)[:, JOINTS.index(dof)]
        run = record(dof, dof, axes, reached - reached[0], seed + turn)
        method = CurrentForce(axes[0].arm_m, coefficient=1.0 / SLOPES[dof])
        name = f"{dof}_force_n"
        columns[name] = run[f"{dof}_torque_n_m"][::EVERY] / axes[0].arm_m
        estimate = method.force_n(run[f"{dof}_current_a"], RATE_HZ)
        columns[f"{ESTIMATED}{name}"] = estimate[::EVERY]
        columns[f"{dof}_current_a"] = run[f"{dof}_current_a"][::EVERY]
    size = len(next(iter(columns.values())))
    time_s = np.arange(size) * EVERY / RATE_HZ
    return Recording("master", time_s, columns, rig="simulated grasper", source="simulated")
