"""Arm link correction: torque at one joint of a correction of the links' parameters."""

from typing import ClassVar

from estimation.effects.effect import Parameter, Proportional


class ArmLinksChange(Proportional):
    """A correction of the links' parameters along a poorly determined direction of their fit.

    Equation: torque = errors change. `change` is the torque for one standard error of the fit on
    all joints together (`estimation.arm.shared`), in N m (N for a prismatic joint); `errors` has no
    unit. The bound of three standard errors is the range that the shared fit allows.

    Check: record another path with the other joints moving.

    Source: the covariance of weighted least squares.
    """

    id = "arm.links.change"
    roles: ClassVar = {"change": "joint_1_links_1_torque_n_m"}
    amplitudes = (
        Parameter("errors", "target / change", "standard errors of the shared fit", -3.0, 3.0),
    )
    told_apart_by = "another path, with the other joints moving"
