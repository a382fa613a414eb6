"""Torque coupling: part of another joint's torque acts on this one."""

from typing import ClassVar

from estimation.effects.effect import Parameter, Proportional


class TorqueCoupling(Proportional):
    """A cable that runs over another joint bears on it with its tension.

    Equation: torque = c other torque.

    Source: the virtual work of a coupled transmission; the transpose of its kinematic coupling.
    """

    id = "coupling.torque"
    balances: ClassVar = {"joint": 1, "grasp": 1, "pitch": 1, "yaw": 1}
    roles: ClassVar = {"other_torque": "joint_1_torque_n_m"}
    amplitudes = (Parameter("ratio", "target / other_torque", "share of the other's torque"),)
    confused_with = ("sensor.crosstalk", "coupling.kinematic")
    told_apart_by = "the other joint loaded alone, with this one at rest and moving"
