"""Variable inertia: an inertia that changes with the angle, as a linkage's or a cam's does."""

from typing import ClassVar

import numpy as np

from estimation.effects.effect import Inputs, Parameter, Parameters, Pointwise, Row, Shape
from estimation.effects.waves import harmonics_in


class InertiaPosition(Pointwise):
    """An inertia that varies over a turn of its shaft: a crank, a linkage, a cam, a folding arm.

    Equation: torque = J(angle) acceleration + 1/2 dJ/dangle speed^2, with J(angle) = a sin(n angle)
    + b cos(n angle), a and b in kg m^2, angle in rad, n the harmonic of the turn.

    Check: repeat the motion at twice the speed around another angle; hold the shaft and look for
    the angle at which the linkage is farthest out.

    Source: Lagrange's equation of a mechanism with one degree of freedom; Goldstein, "Classical
    Mechanics", section 1.4.
    """

    id = "inertia.position"
    balances: ClassVar = {"joint": 1}  # the shafts of the reference rig and the grasper are round
    roles: ClassVar = {
        "position": "joint_angle_rad",
        "speed": "joint_velocity_rad_s",
        "acceleration": "joint_acceleration_rad_s2",
    }
    amplitudes: ClassVar[Parameters] = (
        Parameter("sine", "target / acceleration", "inertia that follows the sine"),
        Parameter("cosine", "target / acceleration", "inertia that follows the cosine"),
    )
    shape: ClassVar[Parameters] = (
        Parameter("harmonic", "1", "periods per turn", 1.0, 2.0, linear=True, points=2),
    )
    told_apart_by = "the same motion around another angle, and at twice the speed"

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        harmonic, phase = shape[0], shape[0] * inputs["position"]
        sine, cosine = np.sin(phase), np.cos(phase)
        square = 0.5 * harmonic * inputs["speed"] ** 2
        return (
            sine * inputs["acceleration"] + cosine * square,
            cosine * inputs["acceleration"] - sine * square,
        )


class InertiaHarmonics(InertiaPosition):
    """An inertia that varies over a turn, not as a pure sine: a crank with a slider, a press.

    Equation: torque = J(angle) acceleration + 1/2 dJ/dangle speed^2, with J(angle) = sum over n =
    1, 2, 3 of a_n sin(n angle) + b_n cos(n angle), a_n and b_n in kg m^2, angle in rad.

    Check: repeat the motion at twice the speed around another angle; hold the shaft and look for
    the angle at which the linkage is farthest out.

    Source: the mass of a slider at the crank, m (ds/dangle)^2, has harmonics 1 to 3 where the rod
    is not much longer than the crank; Norton, "Design of Machinery", chapter 13.
    """

    id = "inertia.position.harmonics"
    meaning = "an inertia that changes over a turn, not as a pure sine, as that of a slider's crank"
    amplitudes = harmonics_in("target / acceleration")
    shape = ()

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        return [x for n in (1.0, 2.0, 3.0) for x in InertiaPosition.row(self, inputs, (n,))]
