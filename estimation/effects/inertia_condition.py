"""Inertia by a condition: a mass that a stated condition of the runs adds, such as a payload."""

from typing import ClassVar

from estimation.effects.effect import Inputs, Parameter, Pointwise, Row, Shape


class ConditionInertia(Pointwise):
    """Inertia that differs between runs as one of their stated conditions does.

    Equation: torque = a condition acceleration, in addition to the inertia. a in kg m^2 per unit of
    the condition.

    Check: compare a with the square of the payload's distance from the axis.

    Source: Newton's second law, with the inertia of a payload in proportion to its mass.
    """

    id = "inertia.condition"
    meaning = "inertia that follows a stated condition of the runs"
    balances: ClassVar = {"grasp": -1, "joint": 1}
    roles: ClassVar = {"acceleration": "motor_acceleration_rad_s2", "condition": "payload_kg"}
    amplitudes = (
        Parameter(
            "slope", "target / acceleration / condition", "inertia per unit of the condition"
        ),
    )
    told_apart_by = "one motion at several values of the condition, and at twice the frequency"

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        return (inputs["condition"] * inputs["acceleration"],)
