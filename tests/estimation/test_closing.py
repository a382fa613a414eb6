"""Which samples close the jaw."""

import numpy as np

from estimation.closing import closing_samples, processed
from estimation.recording import Flag, Stretch
from tests.estimation.synthetic import run


def test_closing_samples_are_fast_enough_and_away_from_the_ends():
    done = processed(run("a", 0.3, 0.1, seed=1), ["motor_current_a"])
    kept = closing_samples(done)
    assert kept["spindle_velocity_rad_s"].min() >= 0.25
    assert kept.time_s.min() >= 1.0
    assert kept.time_s.max() < 7.0
    inner = slice(1000, -1000)
    assert len(kept) == np.count_nonzero(done["spindle_velocity_rad_s"][inner] >= 0.25)


def test_flagged_samples_count_unless_excluded():
    recording = run("a", 0.3, 0.1, seed=1).with_stretch(Stretch(3, 5, Flag.SUSPECT, "test"))
    done = processed(recording, ["motor_current_a"])
    assert len(closing_samples(done, keep_flagged=False)) < len(closing_samples(done))
