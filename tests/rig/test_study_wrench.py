"""`rig study wrench`: tables 3.1 to 3.3 of the thesis on simulated arms."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("pinocchio", reason="Pinocchio is not installed (extra arm)")

from estimation.arm.tables import PSM
from estimation.arm.wrench import body_jacobians, in_tip_frame, spatial_jacobians
from rig.arm.hidden import FAMILIES
from rig.arm.simulated import contact_motion
from rig.studies.wrench.study import BODY, HAND, OURS, SERIES, THESIS, one_arm

pytestmark = pytest.mark.long

FREE = (HAND, SERIES)


def test_the_command_reports_every_family(tmp_path, monkeypatch, answered):
    done = {number: one_arm(number) for number in (0, 1)}
    monkeypatch.setattr(
        "rig.studies.wrench.study.one_arm",
        lambda number: replace(done[min(number, 1)], family=FAMILIES[number]),
    )
    out = tmp_path / "wrench.md"
    words = ("study wrench --seeds 1 --out", out, "--state", tmp_path)
    found = answered(*words, "--figures", tmp_path / "figures")
    assert "figures/wrench-3-3.svg" in out.read_text()
    assert [arm["family"] for arm in found["arms"]] == list(FAMILIES)
    thesis, ours = (
        np.mean([arm["errors"][table][method] for arm in found["arms"] for table in FREE])
        for method in (THESIS, OURS)
    )
    assert ours < thesis
    assert all(f"| {family} |" in out.read_text() for family in FAMILIES)
    assert f"Table {BODY}" in out.read_text()
    assert "| thesis | 2.38 | 4.80 | 12.83 | 6.49 | 15.29 | 18.11 |" in out.read_text()


def test_wrenches_in_the_tip_frame_are_those_of_the_body_jacobian():
    rng = np.random.default_rng(3)
    motion = contact_motion(rng, 1.0)
    wrench = rng.normal(size=(len(motion), 6))
    there = in_tip_frame(PSM, wrench, motion.position)
    at_base, at_tip = (
        np.einsum("nij,ni->nj", jacobians(PSM, motion.position), each)
        for jacobians, each in ((spatial_jacobians, wrench), (body_jacobians, there))
    )
    assert np.allclose(at_base, at_tip)


def test_an_interrupted_study_reports_how_to_go_on(tmp_path, monkeypatch, said):
    def stopped(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("rig.studies.wrench.study.run", stopped)
    assert f"kept in {tmp_path}" in said("study wrench --state", tmp_path, code=130).err
