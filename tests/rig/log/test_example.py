"""The tracked example log: what was written once is read for ever."""

import numpy as np

from rig.importers.registry import open_campaign
from rig.log.check import Verdict, check_log
from tests.conftest import ROOT

EXAMPLE = ROOT / "logs" / "example"


def test_the_example_is_whole_and_reads_as_a_run():
    (log,) = EXAMPLE.glob("*.mcap")
    assert check_log(log).verdict is Verdict.COMPLETE
    (run,) = open_campaign(EXAMPLE)
    assert len(run) == 2000
    assert run.conditions["load_command_a"] == 0.5
    assert run.conditions["frequency_hz"] == 0.5
    np.testing.assert_allclose(run["load_command_a"], 0.5)
    grasp_rad = np.ptp(run["spindle_angle_rad"])
    assert 0.98 * np.pi / 3 < grasp_rad < 1.02 * np.pi / 3
