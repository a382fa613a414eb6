"""A physically consistent fit: masses, inertias and frictions that a real arm can have.

A link's ten parameters belong to some distribution of mass exactly when its pseudo-inertia, a 4 x 4
matrix linear in them, is positive semidefinite (P. M. Wensing, S. Kim, J.-J. E. Slotine, "Linear
matrix inequalities for physically consistent inertial parameter identification", RA-L 3(1), 2018).
Least squares under it is a semidefinite program; Clarabel solves it.
"""

from typing import Any

import numpy as np
from scipy import sparse

from estimation.arm.base import base_of
from estimation.arm.kinematics import ArmError, optional
from estimation.arm.recursion import LINK
from estimation.arm.regressor import names
from estimation.arm.tables import Arm
from estimation.recording import FloatArray

PULL = 1e-6
"""Pull towards small parameters among those that fit alike, as a share of a column's power."""

NOT_NEGATIVE = ("Fv", "Fs", "Ia", "Ke")

ROOT = float(np.sqrt(2.0))


def consistent_fit(
    arm: Arm, base_columns: FloatArray, torque: FloatArray, weights: FloatArray
) -> FloatArray:
    """Return the parameters of least weighted squares among those that a real arm can have.

    They are in the order of `estimation.arm.regressor.names`; those that are not identifiable from
    the torques get the smallest consistent values.

    The columns of its base parameters are of shape (n, joints, base), torque and weights of (n,
    joints) and (joints,).

    Raises:
        MissingExtraError: Clarabel is not installed.
        ArmError: It finds no solution.
    """
    clarabel = optional("clarabel", "A physically consistent fit needs Clarabel")
    mapping = base_of(arm).mapping
    table = (base_columns * weights[:, None]).reshape(-1, base_columns.shape[2])
    aim = (torque * weights).ravel()
    # the triangular factor holds all that least squares needs of the samples
    triangle: FloatArray = np.asarray(np.linalg.qr(np.column_stack([table, aim]), mode="r"))
    whole = triangle[:-1, :-1] @ mapping
    length = np.linalg.norm(whole, axis=0)
    length[length < 1e-9 * length.max()] = 1.0
    scaled = whole / length
    power = scaled.T @ scaled + PULL * np.eye(scaled.shape[1])
    rows, cones = _cones(clarabel, arm)
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    found = clarabel.DefaultSolver(
        sparse.triu(sparse.csc_matrix(power), format="csc"),
        -scaled.T @ triangle[:-1, -1],
        sparse.csc_matrix(-rows / length),
        np.zeros(len(rows)),
        cones,
        settings,
    ).solve()
    if str(found.status) not in ("Solved", "AlmostSolved"):
        raise ArmError(
            "No physically consistent parameters were found.",
            f"Status of Clarabel: {found.status}.",
        )
    return np.asarray(np.array(found.x) / length)


def pseudo_inertia(link: FloatArray) -> FloatArray:
    """Return the pseudo-inertia of a link's ten parameters in the order of `LINK`, shape (4, 4)."""
    m, lx, ly, lz, xx, xy, yy, xz, yz, zz = link
    half = (xx + yy + zz) / 2
    return np.array(
        [
            [half - xx, -xy, -xz, lx],
            [-xy, half - yy, -yz, ly],
            [-xz, -yz, half - zz, lz],
            [lx, ly, lz, m],
        ]
    )


def _cones(clarabel: Any, arm: Arm) -> tuple[FloatArray, list[Any]]:
    """Return rows that must lie in the cones: pseudo-inertias, then non-negative parameters."""
    every = names(arm)
    place = {name: k for k, name in enumerate(every)}
    blocks, cones = [], []
    for body in arm.bodies:
        if body.link == "full":
            at = [place[f"{name}{body.label}"] for name in LINK]
            block = np.zeros((10, len(every)))
            block[:, at] = np.column_stack([_packed(pseudo_inertia(e)) for e in np.eye(10)])
            blocks.append(block)
            cones.append(clarabel.PSDTriangleConeT(4))
    own = [k for k, name in enumerate(every) if name.startswith(NOT_NEGATIVE) and len(name) == 3]
    own += [place[f"m{body.label}"] for body in arm.bodies if body.link == "thin"]
    blocks.append(np.eye(len(every))[own])
    cones.append(clarabel.NonnegativeConeT(len(own)))
    return np.concatenate(blocks), cones


def _packed(matrix: FloatArray) -> FloatArray:
    """Return the upper triangle, column by column, off-diagonal entries times root two."""
    return np.array(
        [matrix[i, j] * (1 if i == j else ROOT) for j in range(4) for i in range(j + 1)]
    )
