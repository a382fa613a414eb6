"""Recordings of one torque equation, with or without an effect that it does not declare."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from estimation import model_file
from estimation.model import Model
from estimation.recording import FloatArray, Recording

RATE_HZ, SECONDS = 250.0, 8.0
Effect = Callable[[FloatArray, FloatArray, FloatArray], FloatArray]
"""Motor angle, motor speed and load to the torque that is lost."""


def motor() -> Model:
    """Return the shipped equation of the motor."""
    return model_file.read(Path("motor"))


def recordings(
    lost: Effect | None = None, runs: int = 12, seed: int = 0, *, spring: bool = False
) -> list[Recording]:
    """Return runs of several speeds against several loads, or against a spring.

    A spring's load follows the angle alone; the current has slow noise then.
    """
    random = np.random.default_rng(seed)
    return [_run(k, lost, random, spring) for k in range(runs)]


def _run(k: int, lost: Effect | None, random: np.random.Generator, spring: bool) -> Recording:
    time = np.arange(int(RATE_HZ * SECONDS)) / RATE_HZ
    waves = [(0.2 + 0.13 * (k % 4) + 0.21 * m, random.uniform(0, 2 * np.pi)) for m in range(3)]
    angle = 10.0 * sum(np.sin(2 * np.pi * f * time + p) / (m + 1) for m, (f, p) in enumerate(waves))
    speed = np.gradient(angle, time)
    acceleration = np.gradient(speed, time)
    load = 0.03 * (1 + k % 3) * (1 + 0.5 * np.sin(2 * np.pi * 0.31 * time + k))
    if spring:
        load = 0.06 + 0.002 * angle
    friction = 2e-5 * acceleration + 1e-4 * speed + 0.02 * np.tanh(speed / 2.0)
    if lost is not None:
        friction = friction + lost(angle, speed, load)
    current = (load + friction) / 1.2 + random.normal(0, 2e-3, len(time))
    if spring:
        slow = random.normal(0, 0.03, len(time) + int(RATE_HZ) - 1)
        current += np.convolve(slow, np.ones(int(RATE_HZ)) / RATE_HZ, "valid")
    return Recording(
        f"{k:02d}",
        time,
        {
            "motor_current_a": current,
            "proximal_torque_n_m": load + random.normal(0, 4e-4, len(time)),
            "motor_angle_rad": angle,
        },
        conditions={"load_command_a": 0.1 * (1 + k % 3)},
        started_at_ns=int(1e9 * 20 * k) + 1,
    )
