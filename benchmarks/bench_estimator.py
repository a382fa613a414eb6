"""What a sample costs: the state estimator's compiled step, and the whole way from raw samples."""

import numpy as np

from benchmarks.ratio import Ratio, best_of
from estimation.bank.states import Bank
from estimation.estimators.bank import BankEstimator

SAMPLES = 20_000
BLOCK = 20
"""Samples that arrive together at 50 refreshes a second of 1 kHz."""

STEP_LIMIT_S = 0.5e-6
PERIOD_S = 1e-3
SHARE = 0.1
"""Share of a core that decoding and estimating may take."""


def measure() -> list[Ratio]:
    """Estimate the same 20 s of a sweep from rows of channels and from raw blocks."""
    bank = Bank("motor_current_a")
    draw = np.random.default_rng(0)
    ranges = np.array([[-1e9], [1e9]]).repeat(bank.judged, axis=1)
    weights = draw.normal(size=bank.size) / bank.size
    estimator = BankEstimator(
        bank, "proximal_torque_n_m", weights, None, ranges, np.ones(bank.size)
    )
    time_s = np.arange(SAMPLES) / 1000.0
    spindle = -0.5 + 0.5 * np.sin(2 * np.pi * 0.3 * time_s)
    measured = {
        "spindle_angle_rad": spindle,
        "motor_angle_rad": 35 * spindle,
        "motor_current_a": 0.2 + 0.1 * spindle + draw.normal(0, 0.003, SAMPLES),
    }
    rows = np.column_stack([measured.get(name, spindle) for name in bank.channels])

    def compiled() -> None:
        for block in np.split(rows, SAMPLES // 1000):
            bank.design(block) @ weights

    def live() -> None:
        stepper = estimator.stepper(1000.0)
        for first in range(0, SAMPLES, BLOCK):
            part = slice(first, first + BLOCK)
            stepper.step(time_s[part], {name: values[part] for name, values in measured.items()})

    compiled()  # compiles
    step_s = best_of(compiled, 5) / SAMPLES
    whole_s = best_of(live) / SAMPLES
    return [
        Ratio(
            "0.5 us over a state estimator's compiled step",
            STEP_LIMIT_S / step_s,
            1.0,
            detail=f"{1e9 * step_s:.0f} ns a sample, {bank.size} weights",
        ),
        Ratio(
            "share of a core that a live estimate takes at 1 kHz, %",
            100 * whole_s / PERIOD_S,
            100 * SHARE,
            higher_is_better=False,
            detail=f"{1e6 * whole_s:.1f} us a sample with filters, blocks of {BLOCK}",
        ),
    ]
