"""Arm links: torque of gravity and inertia of the arm's links at one joint."""

from typing import ClassVar

from estimation.effects.effect import Parameter, Proportional


class ArmLinks(Proportional):
    """Gravity and inertia of an arm's links, whose parameters all joints share.

    Equation: torque = share x links. `links` is the arm's regressor times parameters that were
    fitted on all joints together (`estimation.arm.shared`), in N m (N for a prismatic joint). The
    share has no unit and is near 1.

    Check: a share far from 1 indicates a wrong mass or dimension in the arm's table.

    Source: G. A. Piqué's thesis, 2018, equation 2.5.
    """

    id = "arm.links"
    roles: ClassVar = {"links": "joint_1_links_torque_n_m"}
    amplitudes = (Parameter("share", "target / links", "factor on the torque of all joints' fit"),)
    told_apart_by = "another path, with the other joints moving"
