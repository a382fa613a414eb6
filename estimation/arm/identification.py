"""Identification of an arm: parameters from filtered columns and torques, by least squares."""

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from estimation.arm.kinematics import ArmError
from estimation.arm.motion import LOW_PASS
from estimation.filters import LowPass, zero_phase
from estimation.recording import FloatArray

UNTOLD = 1e-10
"""Smallest singular value, relative to the largest, of columns that are not collinear."""


@dataclass(frozen=True)
class Fit:
    """Identified parameters, in the units of torque over column, and their covariance.

    The condition number is that of the weighted columns, each scaled to unit length.
    """

    values: FloatArray
    covariance: FloatArray
    condition: float

    @property
    def errors(self) -> FloatArray:
        """Standard errors, shape (parameters,). They include noise, not model error."""
        # rounding may leave a damped parameter's variance just below zero
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))


def smoothed(
    columns: FloatArray, sample_rate_hz: float, low_pass: LowPass = LOW_PASS
) -> FloatArray:
    """Filter the columns of a regressor, shape (n, joints, parameters), as the torque is filtered.

    A filter does not commute with friction's sign: columns made from barely filtered motion and
    then filtered belong to the filtered torque, columns made from filtered motion do not.
    """
    flat = zero_phase(columns.reshape(len(columns), -1), sample_rate_hz, low_pass)
    return flat.reshape(columns.shape)


def thesis_weights(torque: FloatArray) -> FloatArray:
    """Return the thesis' weight of each joint, equation 2.11: one over its largest torque.

    The torque is of shape (n, joints).
    """
    return np.asarray(1 / np.abs(torque).max(axis=0))


def fit(
    columns: FloatArray,
    torque: FloatArray,
    weights: FloatArray | None = None,
    damping: float = 0.0,
    independent_share: float = 1.0,
) -> Fit:
    """Fit parameters by ordinary, weighted or damped least squares.

    Args:
        columns: Shape (n, joints, parameters).
        torque: Shape (n, joints).
        weights: Weight of each joint, shape (joints,); None weighs all joints alike.
        damping: Added to the squared length of each weighted column, as a share of it: 0 is plain
            least squares; small values damp weakly identifiable parameters.
        independent_share: Share of the samples that are independent of one another; after a
            low-pass about 2 cutoff / sample rate. Enters the standard errors only.

    Raises:
        ArmError: Without damping, the parameters are not identifiable from the motion.
    """
    joints = torque.shape[1]
    weight = np.ones(joints) if weights is None else weights
    table = (columns * weight[:, None]).reshape(-1, columns.shape[2])
    length = np.linalg.norm(table, axis=0)
    length[length == 0] = 1.0
    table /= length
    # the singular values of the triangular factor are the table's, at a fraction of the cost
    _, singular, basis = linalg.svd(np.linalg.qr(table, mode="r"))
    if damping == 0 and singular[-1] <= UNTOLD * singular[0]:
        worst = np.flatnonzero(np.abs(basis[-1]) > 0.1)
        raise ArmError(
            "The parameters cannot be identified from the motion.",
            f"The columns {', '.join(map(str, worst))} depend on one another.",
            "Reduce them to base parameters, or add damping.",
        )
    inverse = (basis.T / (singular**2 + damping)) @ basis
    target = (torque * weight).ravel()
    values = inverse @ (table.T @ target)
    left = np.square((target - table @ values).reshape(-1, joints))
    noise = left.sum(axis=0) / max(1.0, len(left) - len(values) / joints) / independent_share
    by_joint = table.reshape(-1, joints, len(values))
    spread = np.einsum("njp,j,njr->pr", by_joint, noise, by_joint, optimize=True)
    covariance = inverse @ spread @ inverse / np.outer(length, length)
    return Fit(values / length, covariance, float(singular[0] / singular[-1]))


def damped_around(
    columns: FloatArray, torque: FloatArray, prior: FloatArray, damping: float
) -> FloatArray:
    """Return parameters by damped least squares around a first guess (del Sol et al. 2014).

    theta = theta_0 + (A^T A + lambda^2 I)^-1 A^T (tau - A theta_0), with columns A, (n, joints,
    parameters), torque tau, (n, joints), prior theta_0 and damping lambda, in the unit of the
    columns. The paper's equation 17 omits the first theta_0, without which a perfect guess would
    give zero.

    Raises:
        ArmError: The damping is not positive.
    """
    if not damping > 0:
        raise ArmError(f"A damping of {damping} is not positive.")
    table = columns.reshape(-1, columns.shape[2])
    left = torque.ravel() - table @ prior
    gram = table.T @ table + damping**2 * np.eye(table.shape[1])
    return prior + linalg.solve(gram, table.T @ left, assume_a="pos")


def nrmsd_percent(estimate: FloatArray, torque: FloatArray) -> FloatArray:
    """Return the error of each joint, equation 3.2 of the thesis: RMS over the torque's range, %.

    Estimate and torque are of shape (n, joints).

    Raises:
        ArmError: A joint's torque does not change.
    """
    spread = np.ptp(torque, axis=0)
    if np.any(spread == 0):
        raise ArmError("A joint's torque does not change: its error has no scale.")
    return np.asarray(100 * np.sqrt(np.mean((estimate - torque) ** 2, axis=0)) / spread)
