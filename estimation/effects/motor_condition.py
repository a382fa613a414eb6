"""Gain by a condition: a drive whose gain a stated condition of the runs changes."""

from typing import ClassVar

from estimation.effects.effect import Inputs, Parameter, Pointwise, Row, Shape


class ConditionGain(Pointwise):
    """A gain of the drive that differs between runs as one of their stated conditions does.

    Equation: torque = a condition current, in addition to the usual gain. a in N m/A per unit of
    the condition.

    Check: measure the stall torque at one command at several values of the condition.

    Source: a pulse-width modulated drive gives its motor a share of the supply voltage; Mohan,
    Undeland and Robbins, "Power Electronics", chapter 7.
    """

    id = "motor.condition"
    meaning = "a gain of the drive that follows a stated condition of the runs"
    balances: ClassVar = {"grasp": -1, "joint": 1}
    roles: ClassVar = {"current": "motor_current_a", "condition": "supply_voltage_v"}
    amplitudes = (
        Parameter("slope", "target / current / condition", "gain per unit of the condition"),
    )
    told_apart_by = "stall at one command at several values of the condition"

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        return (inputs["condition"] * inputs["current"],)
