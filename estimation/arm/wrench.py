"""The wrench at an arm's tip from the residual of its joints' torque: offline, and live at 1 kHz.

In contact, tau = model + J^T w (G. A. Piqué's thesis, 2018, equations 3.4 to 3.6), with w what the
tip does to its surroundings: force first, N, then moment, N m.
"""

from dataclasses import dataclass

import numpy as np
from scipy import signal
from scipy.linalg import lapack

from estimation.arm.kinematics import (
    TIP,
    ArmError,
    built,
    check_positions,
    pinocchio,
    tip_pose,
)
from estimation.arm.recursion import LINK
from estimation.arm.regressor import names, sign_width
from estimation.arm.tables import Arm
from estimation.recording import FloatArray

LIKELY_FORCE_N = 20.0
LIKELY_MOMENT_N_M = 4.0
"""Prior standard deviations of wrenches in surgery, which remain in a singular direction. They are
wide, so that they barely bias the observable directions."""


@dataclass(frozen=True)
class Wrench:
    """Wrenches with their covariance."""

    value: FloatArray  # force and moment, shape (n, 6)
    # Shape (n, 6, 6). In unobservable directions it is that of the prior, not zero.
    covariance: FloatArray


def spatial_jacobians(arm: Arm, position: FloatArray) -> FloatArray:
    """Return spatial Jacobians along a motion, shape (n, 6, joints), base frame and origin."""
    return _jacobians(arm, position, "WORLD")


def tip_jacobians(arm: Arm, position: FloatArray) -> FloatArray:
    """Return Jacobians to the tip's twist, tip's origin and base's axes; (n, 6, joints)."""
    return _jacobians(arm, position, "LOCAL_WORLD_ALIGNED")


def body_jacobians(arm: Arm, position: FloatArray) -> FloatArray:
    """Return body Jacobians along a motion, shape (n, 6, joints), tip's frame and origin."""
    return _jacobians(arm, position, "LOCAL")


def _jacobians(arm: Arm, position: FloatArray, frame: str) -> FloatArray:
    check_positions(arm, position)
    pin, model = pinocchio(), built(arm)
    data, tip = model.createData(), model.getFrameId(TIP)
    reference = getattr(pin.ReferenceFrame, frame)
    closure = arm.closure
    return np.stack(
        [
            pin.computeFrameJacobian(model, data, q, tip, reference) @ closure
            for q in position @ closure.T
        ]
    )


def by_pseudo_inverse(jacobians: FloatArray, external_torque: FloatArray) -> FloatArray:
    """Return wrenches by the pseudo-inverse of the transposed Jacobian, equation 3.6, shape (n, 6).

    Jacobians are of shape (n, 6, joints), external torques of (n, joints). Near a singularity the
    result grows without bound; see `most_likely`.
    """
    inverse = np.linalg.pinv(jacobians.transpose(0, 2, 1))
    return np.asarray(np.einsum("nij,nj->ni", inverse, external_torque))


def most_likely(
    jacobians: FloatArray, external_torque: FloatArray, torque_error: FloatArray
) -> Wrench:
    """Return the most likely wrenches, joints weighed by their errors.

    Gaussian: w = (J S^-1 J^T + P^-1)^-1 J S^-1 tau, with Jacobians J, (n, 6, joints), external
    torques tau, (n, joints), S the joints' variances and P that of likely wrenches; the bracket's
    inverse is the covariance.

    Raises:
        ArmError: A joint's standard error of torque is not positive.
    """
    if not np.all(torque_error > 0):
        raise ArmError("A joint's torque has no positive error.", f"They are {torque_error}.")
    weighted = jacobians / torque_error**2
    bracket: FloatArray = weighted @ jacobians.transpose(0, 2, 1) + _likely()
    covariance = np.linalg.inv(bracket).astype(np.float64)
    value = np.einsum("nij,njk,nk->ni", covariance, weighted, external_torque)
    return Wrench(value, covariance)


def _likely() -> FloatArray:
    return np.diag(np.repeat([LIKELY_FORCE_N**-2, LIKELY_MOMENT_N_M**-2], 3))


def in_tip_frame(arm: Arm, wrench: FloatArray, position: FloatArray) -> FloatArray:
    """Return wrenches about the tip in its frame, shape (n, 6).

    They are given in the base frame about its origin, at joint positions of shape (n, joints).
    """
    poses = np.array([tip_pose(arm, q) for q in position])
    force = wrench[:, :3]
    moment = wrench[:, 3:] - np.cross(poses[:, :3, 3], force)
    turned = [np.einsum("nji,nj->ni", poses[:, :3, :3], each) for each in (force, moment)]
    return np.hstack(turned)


WINDOW, DEGREE = 61, 3  # Samples of the live window, odd, and degree of its polynomial


class LiveWrench:
    """Wrench sample by sample: position and torque in, most likely spatial wrench out.

    Position and torque pass the same Savitzky-Golay window, so a lag of one is a lag of the other;
    velocity and acceleration are the window's derivatives at its middle, half a window late.
    """

    def __init__(
        self, arm: Arm, values: FloatArray, torque_error: FloatArray, period_s: float
    ) -> None:
        """Set up with all parameters, in the order of `estimation.arm.regressor.names`.

        The standard error of each joint's torque is of shape (joints,).

        Raises:
            ArmError: The number of parameters is not the arm's.
        """
        if values.shape != (len(names(arm)),):
            raise ArmError(f"{len(names(arm))} parameters are needed, not {values.shape}.")
        self._pin, self._model = pinocchio(), built(arm)
        self._data, self._tip = self._model.createData(), self._model.getFrameId(TIP)
        self._world = self._pin.ReferenceFrame.WORLD
        self._taps = np.stack(
            [
                signal.savgol_coeffs(WINDOW, DEGREE, deriv=k, delta=period_s, use="dot")
                for k in range(3)
            ]
        )
        self._joints = len(arm.joints)
        self._window = np.zeros((2 * WINDOW, 2 * self._joints))
        self._seen = 0
        self._width = sign_width(arm)
        self._links, self._linear, self._coulomb, self._offset = _split(arm, values)
        self._inverse_variance = torque_error**-2.0
        self._prior = _likely()

    def step(self, position: FloatArray, torque: FloatArray) -> FloatArray | None:
        """Take one sample; return the wrench half a window ago, or None while the window fills.

        Position and torque are of shape (joints,).

        Raises:
            ArmError: The sample is not finite.
        """
        window, n = self._taps.shape[1], self._joints
        at = self._seen % window
        # written twice, so that the last window is always contiguous in memory
        for row in (at, at + window):
            self._window[row, :n] = position
            self._window[row, n:] = torque
        self._seen += 1
        if self._seen < window:
            return None
        smooth = self._taps @ self._window[at + 1 : at + 1 + window]
        q, v, a = smooth[:, :n]
        links = self._pin.computeJointTorqueRegressor(self._model, self._data, q, v, a)
        model = links @ self._links + self._linear @ smooth[:, :n].ravel() + self._offset
        model += self._coulomb * np.tanh(v / self._width)
        jacobian = self._pin.computeFrameJacobian(
            self._model, self._data, q, self._tip, self._world
        )
        weighted = jacobian * self._inverse_variance
        _, wrench, failed = lapack.dposv(
            weighted @ jacobian.T + self._prior, weighted @ (smooth[0, n:] - model)
        )
        if failed:
            raise ArmError("The wrench cannot be computed from this sample.", f"Torque: {torque}.")
        found: FloatArray = wrench
        return found


def _split(arm: Arm, values: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return Pinocchio's link parameters, the matrix on (q, v, a), frictions and offsets."""
    named = dict(zip(names(arm), values, strict=True))
    every = range(1, len(arm.joints) + 1)
    links = [named.get(f"{name}{k}", 0.0) for k in every for name in LINK]
    damping = np.diag([named[f"Fv{k}"] for k in every])
    for row, column in arm.viscous_pairs:
        damping[row, column] = named[f"Fv{row + 1}{column + 1}"]
    spring = np.diag([named.get(f"Ke{k}", 0.0) for k in every])
    drive = np.diag([named[f"Ia{k}"] for k in every])
    coulomb, offset = (np.array([named[f"{name}{k}"] for k in every]) for name in ("Fs", "tau0_"))
    return np.array(links), np.hstack([spring, damping, drive]), coulomb, offset
