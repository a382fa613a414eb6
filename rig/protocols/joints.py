"""Runs of a grasper, declared in a protocol file: a joint goes to an angle, or to and fro.

Joints are yaw, pitch and grasp; angles are closing-positive. What is grasped decides the force.
"""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from drivers.teensy.grasper import GRASPER
from rig.configuration.sections import Number, Positive, Section
from rig.protocols import trajectory

JOINTS = ("yaw", "pitch", "grasp")
Joint = Literal["yaw", "pitch", "grasp"]
REST_S = 0.5
"""Rest before and after the motion of a run."""


@dataclass(frozen=True, eq=False)
class JointPlan:
    """One run of a grasper: yaw, pitch and grasp at 2 kHz, shape (n, 3)."""

    name: str
    joint_rad: NDArray[np.float64]
    conditions: dict[str, float | str] = field(default_factory=dict)

    @property
    def samples(self) -> int:
        """Samples the run will have."""
        return len(self.joint_rad)

    @property
    def duration_s(self) -> float:
        """Length of the run."""
        return self.samples / GRASPER.rate_hz


class _JointTable(Section):
    joints: list[Joint] = Field(min_length=1)
    angles_rad: list[Number] = Field(min_length=1)
    repeats: int = Field(default=1, ge=1)

    def _grid(self) -> Iterator[tuple[Joint, float]]:
        for _, joint, angle in itertools.product(range(self.repeats), self.joints, self.angles_rad):
            yield joint, angle


class JointHoldRuns(_JointTable):
    """One joint moves to an angle, holds it and returns, for every joint and angle."""

    kind: Literal["joint_hold"]
    hold_s: Positive = 2.0
    rise_s: Positive = 0.5

    def plans(self) -> Iterator[JointPlan]:
        """Yield one plan for every joint, angle and repeat."""
        rate = GRASPER.rate_hz
        for joint, angle in self._grid():
            rise = trajectory.minimum_jerk(0.0, angle, self.rise_s, rate)
            hold = np.full(round(self.hold_s * rate), angle)
            yield _plan(f"{joint}-hold-{angle:g}", joint, np.concatenate([rise, hold, rise[::-1]]))


class JointSineRuns(_JointTable):
    """One joint goes to an angle and back as a raised cosine, for every joint and angle."""

    kind: Literal["joint_sine"]
    frequencies_hz: list[Positive] = Field(default=[1.0], min_length=1)
    duration_s: Positive = 4.0

    def plans(self) -> Iterator[JointPlan]:
        """Yield one plan for every joint, angle, frequency and repeat."""
        time_s = trajectory.times(self.duration_s, GRASPER.rate_hz)
        for (joint, angle), frequency in itertools.product(self._grid(), self.frequencies_hz):
            turn = 0.5 - 0.5 * np.cos(2 * np.pi * frequency * time_s)
            back = trajectory.minimum_jerk(angle * turn[-1], 0.0, REST_S, GRASPER.rate_hz)
            name = f"{joint}-sine-{angle:g}-{frequency:g}Hz"
            yield _plan(name, joint, np.concatenate([angle * turn, back]))


def _plan(name: str, joint: Joint, angle_rad: NDArray[np.float64]) -> JointPlan:
    """Return a run that moves one joint, with a rest before and after."""
    rest = round(REST_S * GRASPER.rate_hz)
    joint_rad = np.zeros((len(angle_rad) + 2 * rest, len(JOINTS)))
    joint_rad[rest : rest + len(angle_rad), JOINTS.index(joint)] = angle_rad
    conditions: dict[str, float | str] = {"trajectory": name.split("-")[1], "joint": joint}
    return JointPlan(name, joint_rad, conditions)
