"""Spring: torque in proportion to position."""

from typing import ClassVar

from estimation.effects.effect import Parameter, Proportional


class PositionSpring(Proportional):
    """A spring between the moving part and the frame: a hose, a wire, a return spring.

    Equation: torque = k position. Where the spring is relaxed is told by the balance's offset.

    Source: Hooke's law.
    """

    id = "spring.position"
    balances: ClassVar = {"motor": -1, "cable": 1, "grasp": -1, "joint": 1}
    roles: ClassVar = {"position": "spindle_angle_rad"}
    amplitudes = (Parameter("stiffness", "target / position", "torque for one radian"),)
    confused_with = ("transmission.stiffening", "gravity.payload", "friction.position")
    told_apart_by = "a slow free sweep without load, in both directions"
