"""A recorder killed outright loses at most a quarter second, and nothing before that changes."""

import pytest

from benchmarks.reliability.kills import kill_once
from rig.log.writer import MAX_LOSS_S


@pytest.mark.parametrize("seed", range(3))
def test_a_killed_recorder_loses_at_most_a_quarter_second(tmp_path, seed):
    killed = kill_once(tmp_path, seed)
    assert killed.handed_over >= 700
    assert killed.lost_s <= MAX_LOSS_S
