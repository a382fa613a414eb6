"""Samples at rest: found, and kept out of the fit of a model with friction."""

from pathlib import Path

import numpy as np
import pytest

from estimation import model_file
from estimation.campaign import Campaign
from estimation.fitting import fit
from estimation.recording import Recording
from estimation.rest import in_motion


def test_rest_is_where_the_motor_stands_and_a_little_around_it():
    speed = np.concatenate([np.full(500, 10.0), np.zeros(500), np.full(500, -10.0)])
    moving = in_motion(speed, np.ones(1500, bool), 1000.0, 0.7)
    assert moving[:450].all()
    assert moving[1050:].all()
    assert not moving[490:1010].any()


def test_torque_that_friction_holds_at_rest_does_not_move_the_torque_constant():
    """A motor pushes on a joint that sticks: the sensor sees the push less what friction holds."""
    time_s = np.arange(8000) * 1e-3
    motor_rad = 20.0 * np.clip(np.sin(2 * np.pi * 0.5 * time_s), -0.6, 0.6)
    velocity = np.gradient(motor_rad, time_s)
    current_a = 0.2 + 0.1 * np.sin(2 * np.pi * 0.31 * time_s)
    friction = 0.03 * np.tanh(velocity / 0.5)
    held = np.where(np.abs(velocity) < 1e-6, 0.03 * np.sign(current_a - 0.2), friction)
    torque = 0.9 * current_a - held
    run = Recording(
        "a",
        time_s,
        {
            "motor_angle_rad": motor_rad,
            "motor_current_a": current_a,
            "proximal_torque_n_m": torque,
        },
    )
    declared = model_file.read(Path("motor"))
    fitted = fit(declared, Campaign.of([run]), bootstrap=0)
    gain = next(t for t in fitted.terms if t.effect.id == "motor.torque_constant").values["gain"]
    assert gain.value == pytest.approx(0.9, rel=0.03)
