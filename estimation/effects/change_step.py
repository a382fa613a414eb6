"""Friction change within a run: Coulomb friction that changes at one instant of a run."""

from typing import ClassVar

import numba
import numpy as np

from estimation.effects.effect import (
    READING,
    Inputs,
    Parameter,
    Pointwise,
    Remembering,
    Row,
    Shape,
)
from estimation.effects.memory import BEGINNING, age
from estimation.recording import FloatArray


@numba.njit(cache=True)
def _walk(now: FloatArray, shape: FloatArray, state: FloatArray, rows: FloatArray) -> None:
    for i in range(len(now)):
        after = 1.0 if age(now[i, 1], state) >= shape[0] else 0.0
        rows[i, 0] = after * np.tanh(now[i, 0] / shape[1])


class FrictionStep(Remembering):
    """A part that comes loose, jams or is released within a run.

    Equation: torque = F tanh(speed / width) for t >= since, t from the run's start. F in N m, width
    in rad/s, since in s.

    Check: inspect screws, cable guides and the gripped object after the run.

    Source: Page 1955 (a change of a parameter at an unknown point).
    """

    id = "change.step"
    balances: ClassVar = {"motor": -1, "cable": 1, "grasp": -1, "joint": 1}
    roles: ClassVar = {"speed": "motor_velocity_rad_s", "clock": "time_s"}
    amplitudes = (Parameter("friction", "target", "loss after the change minus before"),)
    shape = (
        Parameter("since", "clock", "time of the change in its run", 1.0, 30.0, points=10),
        Parameter("width", "speed", "speed at which 76 % of it acts", 1e-2, 50.0, points=4),
    )
    walk = _walk
    rest = BEGINNING
    told_apart_by = "the run repeated twice as long"


class CampaignFrictionStep(Pointwise):
    """A part that is worn, repaired or exchanged in the course of a campaign.

    Equation: torque = F tanh(speed / width) for t >= since, t from the campaign's start. F in N m,
    width in rad/s, since in s. A change of an offset is excluded, since each run has an offset of
    its own.

    Check: compare the maintenance notes with the time of the change, and repeat the first run.

    Source: Page 1955 (a change of a parameter at an unknown point).
    """

    id = "change.step.campaign"
    meaning = "Coulomb friction that changes at one instant of a campaign"
    family = "change.step"
    balances: ClassVar = {"motor": -1, "cable": 1, "grasp": -1, "joint": 1}
    roles: ClassVar = {"speed": "motor_velocity_rad_s", "campaign_clock": "campaign_time_s"}
    amplitudes = (Parameter("friction", "target", "loss after the change minus before"),)
    shape = (
        Parameter("since", "campaign_clock", "time of the change", 20.0, 2e4, points=20),
        Parameter("width", "speed", "speed at which 76 % of it acts", 0.1, 10.0, points=2),
    )
    told_apart_by = "the first run repeated at the end"

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        after = np.where(inputs["campaign_clock"] >= shape[0], 1.0, 0.0)
        return (after * np.tanh(inputs["speed"] / shape[1]),)


@numba.njit(cache=True)
def _walk_offset(now: FloatArray, shape: FloatArray, state: FloatArray, rows: FloatArray) -> None:
    for i in range(len(now)):
        rows[i, 0] = 1.0 if age(now[i, 0], state) >= shape[0] else 0.0


class OffsetStep(Remembering):
    """A cable that jumps out of its groove, a screw that slips, or a sensor that was knocked.

    Equation: torque = b for t >= since, t from the run's start. b in N m, since in s.

    Check: read the unloaded sensor before and after the run, and inspect cable and sensor mount.

    Source: Page 1955 (a change of a parameter at an unknown point).
    """

    id = "change.step.offset"
    meaning = "an offset that jumps at one instant of a run"
    family = "change.step"
    balances: ClassVar = {**READING, "pitch": 1, "yaw": 1}
    roles: ClassVar = {"clock": "time_s"}
    amplitudes = (Parameter("offset", "target", "level after the change minus before"),)
    shape = (Parameter("since", "clock", "time of the change in its run", 0.5, 60.0, points=33),)
    walk = _walk_offset
    rest = BEGINNING
    told_apart_by = "the unloaded sensor before and after, and the run repeated twice as long"
