"""Change of the arm links: what their parameters may be off by, as one joint feels it."""

from typing import ClassVar

from estimation.effects.effect import Parameter, Proportional


class ArmLinksChange(Proportional):
    """A change of the links' parameters along a direction that their fit is least sure of.

    Equation: torque = errors change, in standard errors of the fit on all joints together
    (`estimation.arm.shared`); more than three are not what that fit allows.

    Source: the covariance of weighted least squares.
    """

    id = "arm.links.change"
    roles: ClassVar = {"change": "joint_1_links_1_torque_n_m"}
    amplitudes = (
        Parameter("errors", "target / change", "standard errors of the shared fit", -3.0, 3.0),
    )
    confused_with = ("arm.links", "gravity.payload", "spring.position")
    told_apart_by = "another path, with the other joints moving"
