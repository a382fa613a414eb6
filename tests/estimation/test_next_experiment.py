"""Which experiment tells rivals apart, where the answer is known beforehand."""

from pathlib import Path

import numpy as np
import pytest

from estimation import model_file
from estimation.campaign import Campaign
from estimation.diagnosis.balance import lay_out
from estimation.diagnosis.candidate import pool
from estimation.diagnosis.design import prepare
from estimation.diagnosis.next_experiment import Worth, worth
from estimation.diagnosis.variables import needed_channels
from estimation.fitting import fit
from estimation.recording import Recording

MOTOR = model_file.read(Path("motor"))
STIFFNESS = 0.12


def run(name: str, frequency_hz: float, load_n_m: float | None, seed: int) -> Recording:
    """A run against one spring, so that load is a function of position; or under a steady load."""
    random = np.random.default_rng(seed)
    time_s = np.arange(6000) * 1e-3
    w = 2 * np.pi * frequency_hz
    angle = 0.6 + 0.5 * np.sin(w * time_s) + 0.1 * np.sin(0.31 * w * time_s + seed)
    speed = 35 * np.gradient(angle, time_s)
    load = STIFFNESS * angle if load_n_m is None else np.full(6000, load_n_m)
    friction = (0.01 + 0.15 * np.abs(load)) * np.tanh(speed / 3)
    current = (load + friction + 2e-5 * np.gradient(speed, time_s)) / 0.94
    return Recording(
        name,
        time_s,
        {
            "motor_angle_rad": 35 * angle,
            "spindle_angle_rad": angle,
            "motor_current_a": current,
            "proximal_torque_n_m": load + 1e-3 * random.normal(size=6000),
        },
    )


@pytest.fixture(scope="module")
def setting():
    recordings = [run(f"r{k}", 0.2 + 0.1 * k, None, k) for k in range(4)]
    fitted = fit(MOTOR, Campaign.of(recordings), bootstrap=0)
    measured = list(recordings[0].columns)
    offered = pool(fitted, measured)
    wanted = {MOTOR.target, *MOTOR.channels, *needed_channels("motor", measured)}
    wanted |= {channel for c in offered for _, channel in c.channels}
    balance = lay_out(fitted, [prepare(r, wanted, fitted) for r in recordings])
    rivals = [
        min(
            (c for c in offered if c.family == family),
            key=lambda c: balance.loss([*balance.terms, c]),
        )
        for family in ("friction.load", "friction.position")
    ]

    def told(name: str, *new: Recording) -> Worth:
        made = [prepare(r, wanted, fitted) for r in new]
        return worth(balance, balance.terms, rivals, name, made, 60.0)

    return told


def test_the_same_again_tells_nothing_and_another_load_tells(setting) -> None:
    same = setting("same", run("n0", 0.35, None, 9))
    other = setting("loads", run("n1", 0.35, 0.02, 10), run("n2", 0.35, 0.15, 11))
    assert set(same.pairs) == {
        ("friction.load", "friction.position"),
        ("friction.position", "friction.load"),
    }
    assert other.discrimination > 20 * same.discrimination
    assert other.net > same.net


def test_time_at_the_rig_costs() -> None:
    pairs = {("a", "b"): 1.0, ("b", "a"): 0.5}
    short, long = Worth("short", 60.0, pairs), Worth("long", 6000.0, pairs)
    assert short.discrimination == long.discrimination == 0.5
    assert short.net > long.net
