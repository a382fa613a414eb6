"""Arms with closed loops: a spanning tree of bodies, and a constant loop closure G.

With the tree's joints q = G y of the actuated y, the torque of y is G^T that of the tree (E. del
Sol et al. 2014, equations 8 to 13, with the actuated joints as y), so the regressor is G^T times
the tree's. A parallelogram moved by angles counted from fixed directions has a constant G.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from estimation.arm.kinematics import ArmError, pinocchio
from estimation.arm.motion import Motion
from estimation.arm.recursion import LINK, Tree, fill_links
from estimation.arm.tables import Body, DhRow
from estimation.recording import FloatArray

FRICTION = ("fc", "fv")


@dataclass(frozen=True, slots=True)
class ClosedChain:
    """An arm with closed loops.

    Attributes:
        name: Name.
        bodies: The spanning tree, parents first.
        tip: The fixed row from the tip's body to the tip.
        tip_body: Number of the tip's body, from 1.
        reach: Half the range of each actuated joint around zero, rad.
        gravity_m_s2: Gravity in the base frame.
        source: Source of the numbers, and what is assumed.
    """

    name: str
    bodies: tuple[Body, ...]
    tip: DhRow
    tip_body: int
    reach: tuple[float, ...]
    gravity_m_s2: tuple[float, float, float]
    source: str

    @property
    def closure(self) -> FloatArray:
        """G, shape (bodies, actuated joints)."""
        return np.array([body.closure for body in self.bodies])


def parameter_names(chain: ClosedChain) -> tuple[str, ...]:
    """Return the names of the regressor's columns: twelve a body, numbered from 1."""
    every = range(1, len(chain.bodies) + 1)
    links = [f"{name}{k}" for k in every for name in LINK]
    return (*links, *(f"{name}{k}" for name in FRICTION for k in every))


@lru_cache(maxsize=8)
def tree(chain: ClosedChain) -> Any:
    """Return the spanning tree as a `pinocchio.Model` with a frame called `tip`."""
    pin = pinocchio()
    model = pin.Model()
    model.gravity = pin.Motion(np.array(chain.gravity_m_s2), np.zeros(3))
    for body in chain.bodies:
        joint = model.addJoint(body.parent, pin.JointModelRZ(), _placed(pin, body.row), body.name)
        model.appendBodyToJoint(joint, pin.Inertia.Zero(), pin.SE3.Identity())
    placement = _placed(pin, chain.tip)
    model.addFrame(pin.Frame("tip", chain.tip_body, 0, placement, pin.FrameType.OP_FRAME))
    return model


def _placed(pin: Any, row: DhRow) -> Any:
    about_x = pin.SE3(pin.utils.rotate("x", row.alpha_rad), np.array([row.a_m, 0.0, 0.0]))
    about_z = pin.SE3(pin.utils.rotate("z", row.theta_rad), np.array([0.0, 0.0, row.d_m]))
    return about_x * about_z


def closed_regressor(chain: ClosedChain, motion: Motion, sign_rad_s: float) -> FloatArray:
    """Return the torque regressor of the actuated joints along their motion.

    Args:
        chain: The arm.
        motion: Motion of the actuated joints.
        sign_rad_s: Speed over which Coulomb friction changes sign.

    Returns:
        Shape (n, actuated, 12 x bodies), columns as in `parameter_names`.

    Raises:
        ArmError: The motion does not fit the arm, or is not finite.
    """
    closure = chain.closure
    state = (motion.position, motion.velocity, motion.acceleration)
    if motion.position.shape[1] != closure.shape[1] or not all(np.isfinite(x).all() for x in state):
        raise ArmError(
            f"A motion of shape {motion.position.shape} does not fit {chain.name}.",
            f"It has {closure.shape[1]} actuated joints; every value must be finite.",
        )
    position, velocity, acceleration = (x @ closure.T for x in state)
    links = np.zeros((len(position), len(closure), len(LINK) * len(closure)))
    to = np.arange(links.shape[2], dtype=np.int64).reshape(len(closure), len(LINK))
    fill_links(_tree(chain), (position, velocity, acceleration), to, links)
    frictions = [
        values[:, None, :] * closure.T for values in (np.tanh(velocity / sign_rad_s), velocity)
    ]
    return np.concatenate([closure.T @ links, *frictions], axis=2)


@lru_cache(maxsize=8)
def _tree(chain: ClosedChain) -> Tree:
    return Tree.of(chain.bodies, chain.gravity_m_s2)


def closed_jacobians(chain: ClosedChain, position: FloatArray) -> FloatArray:
    """Return Jacobians to the tip's twist, tip's origin and base's axes; (n, 6, actuated).

    Args:
        chain: The arm.
        position: Actuated positions, shape (n, actuated), rad.
    """
    pin, model = pinocchio(), tree(chain)
    data, tip = model.createData(), model.getFrameId("tip")
    frame = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    closure = chain.closure
    return np.stack(
        [
            pin.computeFrameJacobian(model, data, q, tip, frame) @ closure
            for q in position @ closure.T
        ]
    )
