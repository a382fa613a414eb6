"""Searches for an excitation: the thesis' active set, and ours within limits at every instant.

G. A. Piqué's thesis, 2018, section 2.4: the condition number is minimised by an active-set method
(sequential quadratic programming) with the limits as constraints at sampled instants. Between those
nothing holds them. Ours goes on from there: every trial is scaled into bounds that hold at every
instant before it is judged, so the search needs no constraints.
"""

import numpy as np
from scipy.optimize import LinearConstraint, minimize

from estimation.arm.excitation import (
    ACCELERATION_PER_SPEED,
    FUNDAMENTAL_HZ,
    HARMONICS,
    Excitation,
    condition,
    fitted,
    numbers_of,
)
from estimation.arm.tables import Arm
from estimation.recording import FloatArray

SAMPLED = 20
"""Instants of a period at which the limits are constraints."""


def by_active_set(arm: Arm, first: Excitation, evaluations: int) -> Excitation:
    """Improve an excitation under limits at sampled instants.

    Args:
        arm: The arm.
        first: The start, within the limits.
        evaluations: Condition numbers it may take, gradients by differences included.
    """
    lower, upper, speed = arm.limits
    half = (upper - lower) / 2
    sizes = np.stack([half, speed, ACCELERATION_PER_SPEED * speed])
    time = np.arange(SAMPLED) / (SAMPLED * FUNDAMENTAL_HZ)

    def excitation(flat: FloatArray) -> Excitation:
        table = flat.reshape(2 * HARMONICS + 1, -1) * half
        return Excitation(table[-1], table[:HARMONICS], table[HARMONICS:-1])

    def room(flat: FloatArray) -> FloatArray:
        """Return the margin to each limit, relative to it; not negative within the limits."""
        motion = excitation(flat).motion(time)
        middle = (lower + upper) / 2
        moved = np.stack([motion.position - middle, motion.velocity, motion.acceleration])
        share = moved / sizes[:, None]
        return np.concatenate([(1 - share).ravel(), (1 + share).ravel()])

    begin = np.concatenate([first.sine, first.cosine, first.middle[None]]) / half
    nothing = room(np.zeros(begin.size))
    # the limits are linear in the coefficients
    linear = np.stack([room(unit) - nothing for unit in np.eye(begin.size)], axis=1)

    def logarithm(flat: FloatArray) -> float:
        return float(np.log(condition(arm, excitation(flat))))

    found = minimize(
        logarithm,
        begin.ravel(),
        method="SLSQP",
        tol=1e-6,
        constraints=LinearConstraint(linear, -nothing, np.inf),
        options={"maxiter": max(1, evaluations // (begin.size + 2))},
    )
    return excitation(found.x)


def improved(arm: Arm, first: Excitation, evaluations: int) -> Excitation:
    """Improve an excitation within limits at every instant.

    Args:
        arm: The arm.
        first: The start, within the limits or not.
        evaluations: Condition numbers it may take, gradients by differences included.
    """
    raw = numbers_of(arm, first)

    def logarithm(trial: FloatArray) -> float:
        return float(np.log(condition(arm, fitted(arm, trial))))

    found = minimize(
        logarithm,
        raw,
        method="SLSQP",
        tol=1e-6,
        options={"maxiter": max(1, evaluations // (raw.size + 2))},
    )
    return fitted(arm, found.x)
