"""Drives and springs that are not linear, on an axis whose drive is what the equation explains."""

from collections.abc import Callable

import numpy as np
import pytest

from estimation.causes.verdict import diagnose
from estimation.diagnosis.split import split
from estimation.recording import FloatArray, Recording
from tests.estimation.causes.synthetic import axis, turning

Needed = Callable[[FloatArray, FloatArray], FloatArray]
GAIN = 0.8


def driven(current: Needed) -> list[Recording]:
    """Return runs whose current is that which the torque needs at the angle."""
    runs = []
    for run in turning(lambda angle, speed, acceleration: 0.0 * speed, size=3.0):
        needed = current(run["crank_torque_n_m"] / GAIN, run["crank_angle_rad"])
        runs.append(Recording(run.name, run.time_s, run.columns | {"crank_current_a": needed}))
    return runs


@pytest.mark.parametrize(
    ("current", "family"),
    [
        (lambda linear, _: linear + 0.1 * np.sign(linear), "motor.dead_zone"),
        (lambda linear, _: np.where(linear > 0, linear, linear / 0.8), "motor.gain_by_side"),
        (lambda linear, angle: linear / (1 - 0.02 * angle**2), "motor.gain_by_position"),
    ],
)
def test_a_drive_that_is_not_linear_is_identified(current: Needed, family: str) -> None:
    runs = driven(current)
    finding = diagnose(runs, [axis("crank_current_a")], split(runs)).findings[0]
    assert family in (finding.family, *finding.alternatives)


def test_of_a_spring_that_hardens_the_whole_curve_is_found() -> None:
    runs = turning(lambda angle, speed, acceleration: 0.05 * angle + 0.02 * angle**3)
    (finding,) = diagnose(runs, [axis()], split(runs)).findings
    assert finding.family == "spring.position"
    assert finding.parameters["stiffness"].value == pytest.approx(0.05, rel=0.1)
    assert finding.parameters["twist"].value == pytest.approx(0.02, rel=0.1)
