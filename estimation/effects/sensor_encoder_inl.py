"""Encoder non-linearity: an angle reading with an error periodic in the angle."""

from typing import ClassVar

from estimation.effects.waves import Waves, harmonics_in, order_of


class EncoderNonlinearity(Waves):
    """A periodic error of an encoder over its turn.

    Its causes are eccentricity (order 1), a tilted magnet (2), or unequal phases (4, or the number
    of lines).

    Equation: error = a sin(order angle) + b cos(order angle), a and b in rad, angle in rad, order
    in periods per turn. In an equation of motion it enters by its rates of change. On the reference
    rig it is a candidate in the equations of angles only: the motor's or the spindle's encoder in
    the gearbox's, the spindle's or the jaw's in the stretch's. The jaw's encoder is the target
    there, and enough harmonics of an angle can represent the angle itself, so its error is computed
    over the prediction of that angle from spindle and load.

    Check: turn slowly without load, and again with the other sensor turned by half a turn; check
    the encoder's mount.

    Source: integral non-linearity of magnetic angle encoders by harmonics of the turn, as their
    makers' data sheets give it.
    """

    id = "sensor.encoder_inl"
    balances: ClassVar = {"gearbox": 1, "stretch": 1}
    roles: ClassVar = {"encoder": "motor_angle_rad"}
    shape = order_of("encoder", 1.0, 32.0, points=32)
    told_apart_by = (
        "a slow sweep without load, repeated with the other sensor turned by half a turn"
    )


class EncoderHarmonics(EncoderNonlinearity):
    """An encoder whose periodic error is not a pure sine.

    Equation: error = sum over n = 1, 2, 3 of a_n sin(n order angle) + b_n cos(n order angle), a_n
    and b_n in rad, angle in rad, order in periods per turn.

    Check: turn slowly without load, and again with the other sensor turned by half a turn.

    Source: the harmonics caused by amplitude, offset and phase errors of the two tracks, as makers
    of magnetic angle encoders state them.
    """

    id = "sensor.encoder_inl.harmonics"
    meaning = "an angle reading with an error periodic in the angle, not as a pure sine"
    amplitudes = harmonics_in("target")
    shape = order_of("encoder", 1.0, 16.0, points=16)
