"""What O'Neill et al. 2018 did and what they found: channels, protocols, Tables I to V as printed.

Source: J. J. O'Neill, T. K. Stephens, T. M. Kowalewski, "Evaluation of torque measurement
surrogates as applied to grip torque and jaw angle estimation of robotic surgical tools", IEEE
Robotics and Automation Letters 2018.
"""

from dataclasses import dataclass

import numpy as np

INSTRUMENT = "Tool_4_Maryland_L_4"
"""Folder of the measured data that the paper's first two experiments were made of."""

PROXIMAL, DISTAL, JAW = TARGETS = ("proximal_torque_n_m", "distal_torque_n_m", "jaw_angle_rad")

FILTERS = ("zero-phase", "live")
"""How the channels of an estimate are filtered here."""

SHOWN = {
    PROXIMAL: ("proximal torque", "mN m", 1e3),
    DISTAL: ("distal torque", "mN m", 1e3),
    JAW: ("jaw angle", "deg", float(np.degrees(1.0))),
}
"""Name, unit and scale of each target."""


def shown(target: str, value: float, digits: int | None = None) -> str:
    """Return a value of a target in the unit it is shown in, by default to its own digits."""
    return f"{SHOWN[target][2] * value:.{digits or (3 if target == JAW else 2)}f}"


SURROGATES = {
    "command": "motor_command_ratio",
    "current": "motor_current_a",
    "gearbox": "gearbox_differential_rad",
}
"""The paper's torque surrogates by short name, and the channel of each."""

POSES = {"neutral": "", "pitch": "wrist_pitch_rad", "roll": "wrist_roll_rad"}
"""The paper's experiments 1 and 2, and the two halves of experiment 3: the input each one adds."""

FOLDS = 5

CONDITIONS = {"lofo": "frequency_hz", "lopo": "load_command_a"}
"""Condition each leave-one-out protocol holds out: one frequency, one power level."""

PROTOCOLS = {
    "authors": "the authors' way: fitted and scored on the last 7/8 of the closing samples",
    "random": "the paper's split: 85 % of the samples at random to fit, 15 % to score",
    "run-wise": f"{FOLDS} folds of whole runs",
    "lofo": "one frequency left out at a time",
    "lopo": "one power level left out at a time",
}

HELD_OUT = {
    "random": "samples at random",
    "run-wise": "runs",
    "lofo": "a frequency (LOFO)",
    "lopo": "a power level (LOPO)",
}
"""Heading of each protocol that holds something out."""

AUTHORS_SKIP = 1 / 8
"""The authors' linear fit omits this first part of the closing samples."""

TEST_SHARE = 0.15
"""Share of the samples that the paper's random split tests on."""

PAPER_SAMPLES = 260_581
PUBLIC_SAMPLES = 308_117
"""Closing samples as the paper states them, and as the public data gives them."""


@dataclass(frozen=True)
class PaperRow:
    """One linear row of the paper's Table I, torques in N m."""

    mae: float
    p95: float
    rmse: float
    pearson_r: float
    spearman_rho: float


PAPER_TABLE_I = {
    "command": PaperRow(10.03e-3, 22.94e-3, 12.18e-3, 0.97, 0.97),
    "current": PaperRow(10.06e-3, 23.26e-3, 12.26e-3, 0.97, 0.97),
    "gearbox": PaperRow(33.91e-3, 76.30e-3, 40.53e-3, 0.60, 0.62),
}

OTHERS_REACH_N_M = {"command": 14.17e-3, "current": 14.24e-3, "gearbox": 43.14e-3}
"""RMSE of the authors' linear fit on the public data as others have reproduced it, N m."""

_FOUR = ("command", "current", "gearbox", "all")
_FIVE = (*_FOUR, "sensor")
_PRINTED: dict[tuple[str, str, str], tuple[str, ...]] = {
    ("neutral", "end-to-end", PROXIMAL): ("4.37 11.54 5.69", "4.47 11.72 5.80",
                                          "11.54 36.89 16.90", "3.82 10.04 4.94"),
    ("neutral", "staged", JAW): ("0.28 0.73 0.36", "0.29 0.74 0.37", "0.65 2.26 1.00",
                                 "0.25 0.64 0.32"),
    ("neutral", "end-to-end", JAW): ("0.28 0.74 0.37", "0.30 0.77 0.38", "0.69 2.33 1.00",
                                     "0.28 0.73 0.36", "0.13 0.33 0.17"),
    ("neutral", "staged", DISTAL): ("3.28 9.49 4.49", "3.37 9.71 4.59", "7.87 25.03 11.65",
                                    "2.92 8.32 3.94"),
    ("neutral", "end-to-end", DISTAL): ("3.33 9.00 4.42", "3.42 9.28 4.72", "8.42 24.91 12.09",
                                        "2.86 7.60 3.75", "1.20 3.39 1.78"),
    ("pitch", "end-to-end", JAW): ("0.26 0.70 0.35", "0.28 0.75 0.37", "0.70 2.12 0.97",
                                   "0.25 0.68 0.34", "0.13 0.34 0.17"),
    ("roll", "end-to-end", JAW): ("0.37 0.99 0.50", "0.36 0.98 0.49", "1.11 2.69 1.39",
                                  "0.35 0.95 0.48", "0.23 0.67 0.34"),
    ("pitch", "end-to-end", DISTAL): ("3.12 8.38 4.16", "3.31 9.02 4.41", "8.63 25.41 11.77",
                                      "2.86 7.37 3.71", "1.64 4.69 2.24"),
    ("roll", "end-to-end", DISTAL): ("5.50 15.42 7.91", "5.62 15.38 7.95", "14.64 34.55 18.08",
                                     "5.37 14.76 7.67", "3.80 12.63 6.31"),
}  # fmt: skip

PAPER: dict[tuple[str, str, str, str], tuple[float, float, float]] = {
    (pose, way, target, surrogate): (mae, p95, rmse)
    for (pose, way, target), rows in _PRINTED.items()
    for surrogate, row in zip(_FIVE, rows, strict=False)
    for mae, p95, rmse in [tuple(map(float, row.split()))]
}
"""(pose, way, target, surrogate) to the network's printed row: mean absolute error, 95th percentile
of the absolute error and root mean square error; mN m for torques, degrees for the jaw angle."""

PAPER_POSE_SAMPLES = 962_936
"""Closing samples of pitch and roll together, as the paper states them."""

GRIP_ARM_M = 0.012
"""Moment arm of the paper's grip force."""

PAPER_GRIP_N, PAPER_GRIP_SHARE = 0.37, 0.035
"""The paper's error of the grip force, and its share of the peak."""
