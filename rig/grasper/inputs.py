"""What a master asks of one axis of the grasper: holds and a periodic squeeze, at 2 kHz."""

import numpy as np

from estimation.recording import FloatArray
from rig.grasper.plant import RATE_HZ, AxisParameters
from rig.protocols.trajectory import minimum_jerk

LEAD_S = 0.5
"""Rest before the motion, and length of the motion itself."""


def hold(axis: AxisParameters, force_n: float, hold_s: float, rise_s: float = LEAD_S) -> FloatArray:
    """Return a grasp up to a force, held, and let go again, rad, shape (n,)."""
    top = _depth(axis, force_n)
    rest = np.zeros(round(LEAD_S * RATE_HZ))
    held = np.full(round(hold_s * RATE_HZ), top)
    return np.concatenate([rest, _rise(0.0, top, rise_s), held, _rise(top, 0.0), rest])


def end_of_hold(hold_s: float) -> tuple[float, float]:
    """Return the last tenth of a second of a hold, as times in the run, s."""
    last = 2 * LEAD_S + hold_s - 0.05
    return last - 0.1, last


def periodic(axis: AxisParameters, force_n: float) -> FloatArray:
    """Return eight squeezes at 2 Hz from first contact up to a force, rad, shape (n,)."""
    time_s = np.arange(round(4 * RATE_HZ)) / RATE_HZ
    squeeze = 0.5 - 0.5 * np.cos(2 * np.pi * 2 * time_s)
    first = axis.contact_rad
    return np.concatenate([_rise(0.0, first), first + (_depth(axis, force_n) - first) * squeeze])


def _depth(axis: AxisParameters, force_n: float) -> float:
    return axis.contact_rad + force_n * axis.arm_m / axis.contact_n_m_rad


def _rise(start: float, stop: float, duration_s: float = LEAD_S) -> FloatArray:
    return minimum_jerk(start, stop, duration_s, RATE_HZ)
