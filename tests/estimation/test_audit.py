"""The audit before a search: clocks, and what was never excited."""

from dataclasses import replace

import numpy as np

from estimation.diagnosis.audit import audit, skips, steady
from estimation.recording import Recording


def run(seed: int = 0, **more: np.ndarray) -> Recording:
    time_s = np.arange(20000) * 1e-3
    angle = {"motor_angle_rad": np.sin(time_s), "spindle_angle_rad": np.sin(time_s) / 35}
    return Recording(f"run{seed}", time_s, {**angle, **more})


def test_skips_and_held_channels_are_reported():
    runs = [
        run(k, load_command_a=np.full(20000, 0.1 * k), motor_current_a=np.zeros(20000))
        for k in range(4)
    ]
    time_s = runs[2].time_s.copy()
    time_s[7000:] += 0.25
    said = audit([*runs[:2], replace(runs[2], time_s=time_s), runs[3]])
    (skip,) = [s for s in said if "skips" in s]
    assert "run2 skips 1 times, the longest by 0.251 s at 7 s" in skip
    assert any(s.startswith("load_command_a is held within each run") for s in said)
    assert any(s.startswith("motor_current_a never varies") for s in said)
    assert not any("skips" in s for s in audit(runs))


def test_a_run_that_jumps_is_left_out_and_one_that_skips_or_is_flagged_is_kept():
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
