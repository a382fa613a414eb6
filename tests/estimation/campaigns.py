"""Campaigns of an analytic rig whose missing effect is known."""

import numpy as np

from tests.estimation import synthetic


def runs(extra=None, count=12, seconds=6.0, first_seed=0):
    random = np.random.default_rng(first_seed)
    return [
        synthetic.run(
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
