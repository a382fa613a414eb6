"""The audit before a search: clocks, delays, and what was never excited."""

from dataclasses import replace

import numpy as np
import pytest

from estimation.diagnosis.audit import audit, delay_s
from estimation.diagnosis.clock import skips, steady
from estimation.recording import Recording


def run(late_s: float = 0.0, seed: int = 0, **more: np.ndarray) -> Recording:
    random = np.random.default_rng(seed)
    time_s = np.arange(20000) * 1e-3
    tones = [(f, random.uniform(0, 6)) for f in (0.6, 1.1, 1.7, 2.9, 4.3, 6.1)]

    def angle(t: np.ndarray) -> np.ndarray:
        return np.sum([np.sin(2 * np.pi * f * t + p) / f for f, p in tones], axis=0)

    noise = 1e-4 * random.normal(size=(2, len(time_s)))
    columns = {
        "motor_angle_rad": 35 * (angle(time_s) + noise[0]),
        "spindle_angle_rad": angle(time_s - late_s) + noise[1],
    }
    return Recording(f"run{seed}", time_s, {**columns, **more})


@pytest.mark.parametrize("late_s", [-4e-3, 0.0, 0.7e-3, 9e-3])
def test_a_delay_is_told_from_the_phase(late_s):
    found = delay_s(run(late_s), "motor_angle_rad", "spindle_angle_rad")
    assert found == pytest.approx(late_s, abs=0.2e-3)


def test_unrelated_or_short_channels_have_no_delay():
    wild = np.random.default_rng(1).normal(size=20000)
    both = run(jaw_angle_rad=np.cumsum(wild))
    assert delay_s(both, "motor_angle_rad", "jaw_angle_rad") is None
    assert delay_s(both.slice_time(0, 2), "motor_angle_rad", "spindle_angle_rad") is None


def test_delays_skips_and_what_is_held_are_said():
    runs = [
        run(5e-3, k, load_command_a=np.full(20000, 0.1 * k), motor_current_a=np.zeros(20000))
        for k in range(4)
    ]
    time_s = runs[2].time_s.copy()
    time_s[7000:] += 0.25
    said = audit([*runs[:2], replace(runs[2], time_s=time_s), runs[3]])
    assert any("spindle_angle_rad comes +5.0 ms after motor_angle_rad" in s for s in said)
    (skip,) = [s for s in said if "skips" in s]
    assert "run2 skips 1 times, the longest by 0.251 s at 7 s" in skip
    assert any(s.startswith("load_command_a is held within each run") for s in said)
    assert any(s.startswith("motor_current_a never varies") for s in said)
    assert not any("skips" in s for s in audit(runs))


def test_a_run_that_jumps_is_left_out_and_one_that_skips_or_says_so_is_kept():
    whole = run()
    time_s = whole.time_s.copy()
    time_s[7000:] += 0.25
    jumps = replace(whole, name="jumps", time_s=time_s)
    flags = np.zeros(len(whole), np.uint8)
    flags[6999:7001] = 1
    flagged = replace(jumps, name="flagged", flags=flags)
    skipping = replace(whole, name="skips", time_s=np.where(time_s > 7.1, time_s - 0.24, time_s))
    kept, lost = steady([whole, jumps, flagged, skipping])
    assert [r.name for r in kept] == ["run0", "flagged", "skips"]
    assert "Run jumps is left out: its clock jumps by 0.251 s at 6.999 s" in lost[0]
    assert [s.split()[4] for s in skips(kept)] == ["flagged", "skips"]
