"""Sensor lag: a reading with a first-order low-pass filter."""

from typing import ClassVar

from estimation.effects.effect import READING, Parameter, Remembering
from estimation.effects.memory import AT_REST, behind


class SensorLag(Remembering):
    """A reading behind a first-order low-pass filter that the other channels do not have.

    Equation: error = a (lagged - reading); d lagged / dt = (reading - lagged) / T, steady on the
    first sample, a in the target's unit per unit of the reading, T in s. A late target appears
    through the model's prediction of it (a > 0), a late regressor with the opposite sign (a < 0):
    motor by the projected load or the current, gearbox by the proximal torque, cable by the distal
    torque, stretch by the distal torque or the spindle's angle.

    Check: compare the filter settings of the amplifiers.

    Source: any anti-aliasing filter or bridge amplifier; Ljung 1999, "System Identification",
    section 13.7 (filters of the channels must match).
    """

    id = "sensor.lag"
    balances = READING
    roles: ClassVar = {"clock": "time_s", "reading": "motor_current_a"}
    # a late reading has the weight of the reading: 1 for the target, at most 1.5 on the rig
    amplitudes = (Parameter("gain", "target / reading", "weight of the late reading"),)
    shape = (Parameter("time_constant", "clock", "time constant of the lag", 5e-4, 0.2, points=6),)
    walk = behind
    rest = AT_REST
    told_apart_by = "a chirp: the lag's gain falls with frequency"
