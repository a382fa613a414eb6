"""Spring: torque or force proportional to position."""

from typing import ClassVar

from estimation.effects.effect import Inputs, Parameter, Pointwise, Proportional, Row, Shape


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
    amplitudes = (
        Parameter("stiffness", "target / position", "torque or force per unit of position"),
    )
    told_apart_by = "a slow free sweep without load, in both directions"


class CurvedSpring(Pointwise):
    """A spring whose stiffness changes smoothly along its travel: it hardens or softens.

    Equation: torque = k position + b position^2 + c position^3, position in rad, k in N m/rad, b in
    N m/rad^2, c in N m/rad^3.

    Check: move slowly without load in both directions and plot torque against position; look for
    hoses and wires that are pulled straight.

    Source: Duffing 1918 for the cube; the square is that of a rest away from position 0.
    """

    id = "spring.position.curved"
    meaning = "a spring whose stiffness changes along its travel"
    family = "spring.position"
    balances: ClassVar = PositionSpring.balances
    roles: ClassVar = PositionSpring.roles
    amplitudes = (
        *PositionSpring.amplitudes,
        Parameter("bend", "target / position / position", "quadratic change with position"),
        Parameter("twist", "target / position / position / position", "cubic change with position"),
    )
    told_apart_by = PositionSpring.told_apart_by

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        position = inputs["position"]
        square = position * position
        return position, square, position * square
