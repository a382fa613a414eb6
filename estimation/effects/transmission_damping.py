"""Transmission damping: a deflection that comes later than the torque that makes it."""

from typing import ClassVar

from estimation.effects.effect import Parameter, Proportional


class TransmissionDamping(Proportional):
    """Viscous damping beside a spring, seen from the torque that both bear together.

    Equation: angle = - damping x d(load)/dt, with damping = c / k^2 for a spring k and a dashpot c.
    To first order it is the dashpot's share of the torque over the spring; the torque's rate is
    cleaner than the rate of a deflection of few encoder counts.

    Source: the Kelvin-Voigt element; Flugge, "Viscoelasticity", 1975, chapter 1.
    """

    id = "transmission.damping"
    roles: ClassVar = {"rate": "proximal_torque_rate_n_m_s"}
    amplitudes = (Parameter("damping", "target / rate", "held back for a unit of rate", 0.0),)
    confused_with = ("sensor.delay", "sensor.lag", "transmission.relaxation")
    told_apart_by = "steps of the load: a delay shows at any rate, damping only while it rises"
