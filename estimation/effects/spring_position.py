"""Spring: torque proportional to position."""

from typing import ClassVar

from estimation.effects.effect import Parameter, Proportional


class PositionSpring(Proportional):
    """A spring between the moving part and the frame: a hose, a wire, a return spring.

    Equation: torque = k position, position in rad, k in N m/rad. The equation's offset determines
    the relaxed position.

    Check: move slowly without load in both directions; look for hoses and wires that are pulled.

    Source: Hooke's law.
    """

    id = "spring.position"
    balances: ClassVar = {"motor": -1, "cable": 1, "grasp": -1, "joint": 1}
    roles: ClassVar = {"position": "spindle_angle_rad"}
    amplitudes = (Parameter("stiffness", "target / position", "torque per radian"),)
    told_apart_by = "a slow free sweep without load, in both directions"
