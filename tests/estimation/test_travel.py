"""The ratio between two recorded travels, next to a torque that winds up what is between them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimation.recording import Recording
from estimation.travel import slope


def run(ratio: float, compliance: float) -> Recording:
    """Return a run in which a torque winds up a gearbox while it turns."""
    time_s = np.arange(0.0, 4.0, 0.002)
    angle = np.sin(2.0 * time_s)
    torque = 0.3 * angle + 0.1 * np.sin(7.0 * time_s)
    motor = ratio * (angle + compliance * torque)
    columns = {"spindle_angle_rad": angle, "motor_angle_rad": motor, "proximal_torque_n_m": torque}
    return Recording("run", time_s, columns)


@given(st.floats(2.0, 200.0), st.floats(0.0, 0.2))
def test_a_compliance_is_not_taken_for_another_ratio(ratio, compliance):
    runs = [run(ratio, compliance)]
    found = slope(runs, "spindle_angle_rad", "motor_angle_rad", ["proximal_torque_n_m"])
    assert found == pytest.approx(ratio, rel=1e-6)


def test_what_never_moves_has_no_slope():
    still = run(35.0, 0.01).with_columns(spindle_angle_rad=np.zeros(2000))
    assert slope([still], "spindle_angle_rad", "motor_angle_rad") is None
