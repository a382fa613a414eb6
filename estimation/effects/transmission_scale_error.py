"""Scale error: a transmission whose ratio, or an encoder whose scale, is not the declared one."""

from typing import ClassVar

from estimation.effects.effect import (
    REFERENCE_K,
    Inputs,
    Parameter,
    Parameters,
    Pointwise,
    Row,
    Shape,
)


class ScaleError(Pointwise):
    """A position after a transmission that is off by a share of itself.

    Equation: deflection = a position. a in the target's unit per unit of the position.

    Check: count teeth or measure the lead, and compare both encoders with a third one.

    Source: lead error of a screw, ISO 3408-3 (travel deviation over the useful travel).
    """

    id = "transmission.scale_error"
    balances: ClassVar = {"stretch": -1}
    roles: ClassVar = {"position": "spindle_angle_rad"}
    amplitudes: ClassVar[Parameters] = (
        Parameter("share", "target / position", "deviation per unit of the position"),
    )
    told_apart_by = "a third encoder: a ratio and the scale of an encoder have the same form"

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        return (inputs["position"],)


class CurvedScaleError(ScaleError):
    """A ratio that changes along the travel, as the lead of a worn screw or a filling drum does.

    Equation: deflection = a position^2 + b position^3. a and b in the target's unit per square and
    cube of the unit of the position.

    Check: compare both encoders with a third one at several positions.

    Source: lead error of a screw, ISO 3408-3 (travel deviation over the useful travel).
    """

    id = "transmission.scale_error.curved"
    meaning = "a ratio that changes along the travel"
    amplitudes = (
        Parameter("bend", "target / position / position", "change of the share with the position"),
        Parameter("twist", "target / position / position / position", "change with its square"),
    )
    told_apart_by = "a third encoder at several positions"

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        return (inputs["position"] ** 2, inputs["position"] ** 3)


class ThermalScaleError(ScaleError):
    """A ratio that follows a measured temperature, as the lead of a screw that expands.

    Equation: deflection = a position (temperature - 298.15 K). a in the target's unit per unit of
    the position and K, temperature in K.

    Check: move to the same position cold and warm, and compare both encoders.

    Source: linear thermal expansion, 11e-6 /K of steel.
    """

    id = "transmission.scale_error.thermal"
    meaning = "a ratio, or an encoder's scale, that follows a measured temperature"
    roles: ClassVar = {"position": "spindle_angle_rad", "temperature": "motor_temperature_k"}
    amplitudes = (
        Parameter("rate", "target / position / temperature", "change of the share per kelvin"),
    )
    told_apart_by = "the same position when the transmission is cold and when it is warm"

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        return (inputs["position"] * (inputs["temperature"] - REFERENCE_K),)
