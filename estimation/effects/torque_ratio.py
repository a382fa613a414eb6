"""Torque ratio: torque at one end of the transmission proportional to the other end's."""

from typing import ClassVar

from estimation.effects.effect import Parameter, Proportional


class TorqueRatio(Proportional):
    """Ideal transmission of torque by cable and pulleys.

    Equation: torque = ratio x load, both in N m, the ratio without unit.

    Check: compare the ratio with the pulley diameters.

    Source: O'Neill et al. 2018, section II.A (spindle and jaw torque sensors at the two ends).
    """

    id = "transmission.ratio"
    roles: ClassVar = {"load": "distal_torque_n_m"}
    amplitudes = (Parameter("ratio", "target / load", "torque here per unit of torque there"),)
    told_apart_by = "loading and unloading at the same slow speed"
