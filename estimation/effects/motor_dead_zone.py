"""Dead zone: a drive that gives no torque for small commands."""

from typing import ClassVar

import numpy as np

from estimation.effects.effect import Inputs, Parameter, Parameters, Pointwise, Row, Shape


class DeadZone(Pointwise):
    """A drive whose small commands have no effect: a valve with overlap, an amplifier, a PWM stage.

    Equation: loss = K min(max(current, -edge), edge), K in N m/A, current and edge in A.

    Check: raise the command slowly from zero to both sides at a stalled output, and note where the
    torque begins.

    Source: the dead zone of an actuator; Tao and Kokotovic, "Adaptive Control of Systems with
    Actuator and Sensor Nonlinearities", 1996.
    """

    id = "motor.dead_zone"
    balances: ClassVar = {"grasp": -1}
    roles: ClassVar = {"current": "motor_current_a"}
    amplitudes = (
        Parameter("gain", "target / current", "torque constant beyond the edge", lower=0.0),
    )
    shape: ClassVar[Parameters] = (
        Parameter("edge", "current", "command at which the torque begins", 0.005, 2.0),
    )
    told_apart_by = "a slow rise of the command from zero to both sides, stalled"

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        return (np.minimum(np.maximum(inputs["current"], -shape[0]), shape[0]),)
