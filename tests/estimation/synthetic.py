"""A small analytic rig for the tests: its torques are known formulas of its motion."""

from collections.abc import Callable

import numpy as np

from estimation.campaign import Campaign
from estimation.recording import FloatArray, Recording

RATE_HZ = 1000.0
TRUE = {"gain": 0.94, "inertia": 2e-5, "damping": 4e-4, "friction": 0.012, "width": 3.0}

Extra = Callable[[FloatArray, FloatArray, FloatArray], FloatArray]
"""Further torque (N m) of motor angle, motor speed and load."""


def run(
    name, frequency_hz, load_n_m, *, seed, seconds=8.0, noise_n_m=1e-3, offset_n_m=0.0, extra=None
) -> Recording:
    """Return one run of the analytic rig.

    The spindle follows a sine with a slower one on top; the current is what the balance
    `proximal = K i - J a - b w - F tanh(w / width) + offset` asks for.
    """
    random = np.random.default_rng(seed)
    time_s = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    w1, w2 = 2 * np.pi * frequency_hz, 2 * np.pi * frequency_hz * 0.31
    parts = ((0.5, w1, 0.0), (0.15, w2, 1.0 + seed))
    angle = sum(a * np.sin(w * time_s + p) for a, w, p in parts)
    speed = sum(35 * a * w * np.cos(w * time_s + p) for a, w, p in parts)
    acceleration = sum(-35 * a * w**2 * np.sin(w * time_s + p) for a, w, p in parts)
    motor = 35 * angle
    load = load_n_m * (1.2 + np.sin(2 * np.pi * 0.9 * frequency_hz * time_s + seed))
    proximal = load + 0.02 * angle
    losses = (
        TRUE["inertia"] * acceleration
        + TRUE["damping"] * speed
        + TRUE["friction"] * np.tanh(speed / TRUE["width"])
    )
    if extra is not None:
        losses = losses + extra(motor, speed, load)
    noise = noise_n_m * random.normal(size=len(time_s))
    return Recording(
        name,
        time_s,
        {
            "motor_angle_rad": motor,
            "spindle_angle_rad": angle,
            "motor_current_a": (proximal + losses) / TRUE["gain"],
            "motor_command_ratio": (proximal + losses) / TRUE["gain"] / 2.06,
            "proximal_torque_n_m": proximal + offset_n_m + noise,
            "distal_torque_n_m": proximal / 1.4,
        },
        conditions={"frequency_hz": frequency_hz, "load_command_a": load_n_m},
    )


def campaign(extra: Extra | None = None, noise_n_m: float = 1e-3) -> Campaign:
    """Return nine runs over three frequencies and three loads, each with an offset of its own."""
    random = np.random.default_rng(7)
    return Campaign.of(
        run(
            f"{f}{t}",
            0.2 + 0.15 * f,
            0.05 * (t + 1),
            seed=10 * f + t,
            noise_n_m=noise_n_m,
            offset_n_m=0.02 + 0.005 * random.normal(),
            extra=extra,
        )
        for f in range(3)
        for t in range(3)
    )


def campaign_with_jaw() -> Campaign:
    """Return the campaign with a jaw whose angle differs from the spindle's by the grip."""
    return Campaign.of(
        run.with_columns(
            jaw_angle_rad=1.2 + run["spindle_angle_rad"] - run["distal_torque_n_m"] / 2
        )
        for run in campaign()
    )


def runs(extra=None, count=12, seconds=6.0, first_seed=0):
    random = np.random.default_rng(first_seed)
    return [
        run(
            f"run{k:02d}",
            0.2 + 0.15 * (k % 3),
            0.05 * (1 + k // 3),
            seed=first_seed + k,
            seconds=seconds,
            offset_n_m=0.02 + 0.005 * random.normal(),
            extra=extra,
        )
        for k in range(count)
    ]


def spring(motor_rad, speed_rad_s, load_n_m):
    return 0.02 * motor_rad / 35


def spring_and_ripple(motor_rad, speed_rad_s, load_n_m):
    return spring(motor_rad, speed_rad_s, load_n_m) + 0.0025 * np.sin(3 * motor_rad)
