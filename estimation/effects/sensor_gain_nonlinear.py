"""Non-linear gain: a sensor whose slope changes over its range."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

from estimation.effects.effect import Parameter, Pointwise


class NonlinearGain(Pointwise):
    """The square and the cube of a reading, as the certificate of a sensor gives them.

    Equation: error = a reading^2 + b reading^3. The bend of the target shows through what the
    balance says of it, the bend of a regressor by itself: motor by the projected load or the
    current, gearbox by the proximal torque, cable by the distal torque, stretch by the distal
    torque or the spindle's angle.

    Source: polynomial calibration of force transducers, ISO 376:2011, annex (cubic fit).
    """

    id = "sensor.gain_nonlinear"
    balances: ClassVar = {"motor": 1, "gearbox": 1, "cable": 1, "stretch": 1, "grasp": 1}
    roles: ClassVar = {"reading": "motor_load_n_m"}
    amplitudes = (
        Parameter("square", "target / reading / reading", "part that bends to one side"),
        Parameter("cube", "target / reading / reading / reading", "part that bends to both"),
    )
    confused_with = (
        "motor.saturation",
        "transmission.stiffening",
        "friction.load",
        "spring.position",
        "sensor.creep",
    )
    bends = ("reading",)
    told_apart_by = "reference weights over the sensor's whole range, both signs"

    def row(self, inputs: Mapping[str, Any], shape: Sequence[float]) -> Sequence[Any]:
        """Return the square and the cube."""
        reading = inputs["reading"]
        square = reading * reading
        return square, square * reading
