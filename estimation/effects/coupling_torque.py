"""Torque coupling: a fraction of another joint's torque acts on this joint."""

from typing import ClassVar

from estimation.effects.effect import Parameter, Proportional


class TorqueCoupling(Proportional):
    """The tension of another joint's cable loads this joint, which the cable crosses.

    Equation: torque = c other torque, both in N m, c without unit.

    Check: load the other joint alone and read this joint's torque.

    Source: the virtual work of a coupled transmission; the transpose of its kinematic coupling.
    """

    id = "coupling.torque"
    balances: ClassVar = {"joint": 1, "grasp": 1, "pitch": 1, "yaw": 1}
    roles: ClassVar = {"other_torque": "joint_1_torque_n_m"}
    amplitudes = (Parameter("ratio", "target / other_torque", "fraction of the other's torque"),)
    told_apart_by = "the other joint loaded alone, with this one at rest and moving"
