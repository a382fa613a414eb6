"""Arm links: the torque that the moving links of an arm need at one joint."""

from typing import ClassVar

from estimation.effects.effect import Parameter, Proportional


class ArmLinks(Proportional):
    """Gravity and inertia of an arm's links, whose parameters all joints share.

    Equation: torque = share x links; the links' torque is the arm's regressor times parameters that
    were fitted on all joints together (`estimation.arm.shared`), so the share is near 1.

    Source: G. A. Piqué's thesis, 2018, equation 2.5.
    """

    id = "arm.links"
    roles: ClassVar = {"links": "joint_1_links_torque_n_m"}
    amplitudes = (Parameter("share", "target / links", "share of the torque of all joints' fit"),)
    confused_with = ("inertia.missing", "gravity.payload", "spring.position")
    told_apart_by = "another path, with the other joints moving"
