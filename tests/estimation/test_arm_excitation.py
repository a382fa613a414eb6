"""Excitation within limits at every instant, and a better condition than at the start."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from estimation.arm.excitation import (
    ACCELERATION_PER_SPEED,
    FUNDAMENTAL_HZ,
    by_active_set,
    condition,
    fitted,
    improved,
    numbers_of,
    start,
)
from estimation.arm.tables import PSM
from rig.cli.study import study_app

pytest.importorskip("pinocchio", reason="Pinocchio is not installed (extra arm)")


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000), st.floats(0, 1))
def test_limits_hold_between_the_sampled_instants(seed, phase):
    time = (np.arange(7919) + phase) / (7919 * FUNDAMENTAL_HZ)
    motion = fitted(PSM, start(PSM, seed)).motion(time)
    for k, joint in enumerate(PSM.joints):
        assert joint.lower <= motion.position[:, k].min()
        assert motion.position[:, k].max() <= joint.upper
        assert np.abs(motion.velocity[:, k]).max() <= joint.speed
        assert np.abs(motion.acceleration[:, k]).max() <= ACCELERATION_PER_SPEED * joint.speed


def test_the_command_writes_a_table_and_a_trajectory_within_limits(tmp_path):
    out, path = tmp_path / "excitation.md", tmp_path / "trajectory.csv"
    words = ["excitation", "--starts", "1", "--evaluations", "150", "--out", str(out)]
    ran = CliRunner().invoke(study_app, [*words, "--trajectory", str(path), "--json"])
    assert ran.exit_code == 0, ran.output
    (row,) = json.loads(ran.stdout)["starts"]
    assert row["ours"]["condition"] < row["condition"]
    assert row["ours"]["limits_share"] <= 1 + 1e-9
    assert "active set: condition" in out.read_text()
    values = np.loadtxt(path, delimiter=",", skiprows=1)
    assert values.shape == (2000, 7)
    for k, joint in enumerate(PSM.joints):
        assert joint.lower <= values[:, k + 1].min() < values[:, k + 1].max() <= joint.upper


@pytest.mark.long
def test_a_search_is_never_worse_than_its_start():
    """From this start the last trial of a search is eight times worse than the start."""
    first = by_active_set(PSM, fitted(PSM, start(PSM, 1)), 3000)
    scaled = fitted(PSM, numbers_of(PSM, first))
    assert condition(PSM, improved(PSM, first, 3000)) <= condition(PSM, scaled)
