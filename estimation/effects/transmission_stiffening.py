"""Stiffening: a transmission whose stiffness grows with the load."""

from typing import ClassVar

import numpy as np

from estimation.effects.effect import Inputs, Parameter, Parameters, Pointwise, Row, Shape


class Stiffening(Pointwise):
    """Two stiffnesses with a smooth transition, of teeth in contact or a cable pulled straight.

    Equation: deflection lost = c (load - knee tanh(load / knee)), load and knee in N m, c in
    rad/(N m).

    Check: load slowly to both sides against a reference weight and plot deflection against load;
    check the cable's pretension.

    Source: the stiffness curve of gearheads as makers state it, a soft and a stiff part.
    """

    id = "transmission.stiffening"
    balances: ClassVar = {"gearbox": -1, "stretch": 1}
    roles: ClassVar = {"load": "proximal_torque_n_m"}
    amplitudes = (Parameter("compliance", "target / load", "compliance lost at load", lower=0.0),)
    shape: ClassVar[Parameters] = (
        Parameter("knee", "load", "load at the knee", 0.02, 1.0, points=9),
    )
    told_apart_by = "a slow ramp of load against a reference weight, to both sides"

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        return (inputs["load"] - shape[0] * np.tanh(inputs["load"] / shape[0]),)


class AsymmetricStiffness(Stiffening):
    """A transmission that deflects more in one direction of load than in the other.

    Equation: deflection = c |load|, load in N m, c in rad/(N m): half the compliance of closing
    minus half that of opening.

    Check: load slowly to both sides against a reference weight and compare the slopes.

    Source: Hooke's law with a separate constant for either side.
    """

    id = "transmission.stiffening.asymmetric"
    meaning = "a transmission that deflects more in one direction of load than in the other"
    balances: ClassVar = {"gearbox": 1, "stretch": -1}
    amplitudes = (
        Parameter("asymmetry", "target / load", "half the compliance of load > 0 less load < 0"),
    )
    shape = ()

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        return (np.abs(inputs["load"]),)


class CubicStiffening(Stiffening):
    """A stiffness curve that bends without a knee; c is negative where it softens.

    Equation: deflection lost = c load^3, load in N m, c in rad/(N m)^3.

    Check: load slowly to both sides against a reference weight and plot deflection against load.

    Source: the stiffness of flexible gears by an odd polynomial, Tuttle and Seering 1996.
    """

    id = "transmission.stiffening.cubic"
    meaning = "a transmission whose stiffness changes with the square of the load"
    amplitudes = (
        Parameter("bend", "target / load / load / load", "deflection lost at one unit of load"),
    )
    shape = ()

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        return (inputs["load"] ** 3,)
