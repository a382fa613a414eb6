"""Transmission damping: a deflection that lags behind the torque."""

from typing import ClassVar

from estimation.effects.effect import Parameter, Proportional


class TransmissionDamping(Proportional):
    """Viscous damping parallel to a spring, as a function of the total torque.

    Equation: angle = - damping x d(load)/dt, with damping = c / k^2 for a spring k in N m/rad and a
    dashpot c in N m s/rad; load in N m, damping in rad s/(N m). To first order it is the dashpot's
    torque divided by the stiffness; the rate of the torque is less noisy than the rate of a
    deflection of few encoder counts.

    Check: apply steps of the load; a delay is visible at any rate, damping only while the load
    changes.

    Source: the Kelvin-Voigt element; Flugge, "Viscoelasticity", 1975, chapter 1.
    """

    id = "transmission.damping"
    roles: ClassVar = {"rate": "proximal_torque_rate_n_m_s"}
    amplitudes = (Parameter("damping", "target / rate", "deflection per unit of rate", 0.0),)
    told_apart_by = "steps of the load: a delay is visible at any rate, damping only while it rises"
