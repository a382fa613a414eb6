"""Offset change within a run: an offset that changes at one instant of a run."""

from typing import ClassVar

import numba

from estimation.effects.effect import Parameter, Remembering
from estimation.recording import FloatArray


@numba.njit(cache=True)
def _walk(now: FloatArray, shape: FloatArray, state: FloatArray, rows: FloatArray) -> None:
    """Fill the rows; state: started (0 or 1), the time of the first."""
    for i in range(len(now)):
        if not state[0]:
            state[0], state[1] = 1.0, now[i, 0]
        rows[i, 0] = 1.0 if now[i, 0] - state[1] >= shape[0] else 0.0


class OffsetStep(Remembering):
    """A cable that jumps out of its groove, a screw that slips, or a sensor that was knocked.

    Equation: torque = b for t >= since, t from the run's start. b in N m, since in s.

    Check: read the unloaded sensor before and after the run, and inspect cable and sensor mount.

    Source: Page 1955 (a change of a parameter at an unknown point).
    """

    id = "change.step.offset"
    family = "change.step"
    balances: ClassVar = {
        "motor": 1,
        "gearbox": 1,
        "cable": 1,
        "stretch": 1,
        "grasp": 1,
        "pitch": 1,
        "yaw": 1,
        "joint": 1,
    }
    roles: ClassVar = {"clock": "time_s"}
    amplitudes = (Parameter("offset", "target", "level after the change minus before"),)
    shape = (Parameter("since", "clock", "time of the change in its run", 0.5, 60.0, points=33),)
    walk = _walk
    rest = (0.0, 0.0)
    told_apart_by = "the unloaded sensor before and after, and the run repeated twice as long"
