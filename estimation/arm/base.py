"""Base parameters: the combinations of an arm's parameters identifiable from its joint torques.

M. Gautier, "Numerical calculation of the base inertial parameters of robots", 1991: a QR
decomposition of the regressor at random motions shows which columns depend on those before them.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from estimation.arm.motion import Motion
from estimation.arm.regressor import names, regressor
from estimation.arm.tables import Arm
from estimation.recording import FloatArray

SAMPLES = 500
BESIDE = 100
DEPENDENT = 1e-9
"""Relative norm below which the residual of a column is rounding."""


@dataclass(frozen=True)
class Base:
    """A base of an arm's parameters."""

    columns: NDArray[np.intp]  # the regressor's columns of the base
    mapping: FloatArray  # base parameters of all parameters, shape (base, parameters)
    names: tuple[str, ...]  # the combinations in words, such as `ly1 + lz2`


@lru_cache(maxsize=8)
def base_of(arm: Arm) -> Base:
    """Find the base parameters of an arm over its whole range of motion.

    A property of the arm's table, not of a recording: the motions are random within its limits.
    Columns are taken in the order friction, springs, offsets, drives, then links from the base to
    the tip: a friction keeps its own name, and a link's parameter joins those before it.
    """
    rng = np.random.default_rng(0)
    shape = (SAMPLES, len(arm.joints))
    lower, upper, speed = arm.limits
    motion = Motion(
        position=rng.uniform(lower, upper, shape),
        velocity=rng.uniform(-speed, speed, shape),
        acceleration=10 * rng.uniform(-speed, speed, shape),
        period_s=1.0,
    )
    stacked, all_names = np.concatenate(list(regressor(arm, motion).transpose(1, 0, 2))), names(arm)
    norms = np.linalg.norm(stacked, axis=0)
    order = np.array(sorted(range(len(all_names)), key=lambda k: _rank(all_names[k])))
    norms = np.where(norms > DEPENDENT * norms.max(), norms, np.inf)  # others act on no joint
    scaled = stacked[:, order] / norms[order]
    # whether each unit column depends on those before it
    independent = np.abs(np.diag(np.linalg.qr(scaled, mode="r"))) > DEPENDENT
    kept, rest = np.sort(order[independent]), np.sort(order[~independent])
    relations = np.linalg.lstsq(stacked[:, kept], stacked[:, rest], rcond=None)[0]
    mapping = np.zeros((len(kept), len(all_names)))
    mapping[np.arange(len(kept)), kept] = 1.0
    mapping[:, rest] = np.where(np.abs(relations) > 1e-8, relations, 0.0)
    return Base(kept, mapping, tuple(_combination(row, all_names) for row in mapping))


def _rank(name: str) -> tuple[int, int]:
    link = int(name[-1]) if name[-1].isdigit() else BESIDE  # bodies of a loop come last
    kind = 0 if name.startswith(("F", "f", "Ke", "tau0")) else 1 if name.startswith("Ia") else 2
    return kind, link


def _combination(row: FloatArray, all_names: tuple[str, ...]) -> str:
    words = ""
    for k in np.flatnonzero(row):
        size = abs(row[k])
        factor = "" if np.isclose(size, 1.0) else f"{size:.4g} "
        joint = (" + " if row[k] > 0 else " - ") if words else ("" if row[k] > 0 else "-")
        words += f"{joint}{factor}{all_names[k]}"
    return words
