"""`rig study delsol` on one simulated hydraulic arm."""

import numpy as np
import pytest

from rig.arm.hidden import FAMILIES
from rig.output.provenance import Provenance
from rig.studies.delsol import study as delsol
from rig.studies.delsol.page import page
from rig.studies.delsol.study import PULLS, DelSolStudy, Named

pytestmark = pytest.mark.long

pytest.importorskip("pinocchio", reason="Pinocchio is not installed (extra arm)")


def test_the_command_finds_the_hoses_and_does_better_than_the_paper(
    tmp_path, monkeypatch, answered
):
    done = delsol.one_arm(0)
    monkeypatch.setattr(delsol, "one_arm", lambda number: done)
    out = tmp_path / "delsol.md"
    words = ("study delsol --seeds 1 --out", out, "--state", tmp_path)
    found = answered(*words, "--figures", tmp_path / "figures")
    assert "figures/delsol-forces.svg" in out.read_text()
    assert len(found["named"]) == len(FAMILIES)
    named = [({each["family"], *each["alternatives"]}, each) for each in found["named"][0]]
    pulls = [each for names, each in named if names & {*PULLS}]
    assert [each["joint"] for each in pulls] == [1]
    assert pulls[0]["after_n_m"] < 0.95 * pulls[0]["before_n_m"]
    assert {each["joint"] for each in found["named"][0]} == {1, 2, 3, 4, 5}  # friction with memory
    paper, ours = (found["outcomes"][name][0] for name in (delsol.PAPER, delsol.OURS))
    assert np.all(np.array(ours["residual_n_m"]) < paper["residual_n_m"])
    assert ours["impact_n"] < paper["impact_n"]
    assert "| paper | 26.10 | 12.98 | 6.81 |" in out.read_text()
    assert found["outcomes"][delsol.DISCARDED] != found["outcomes"][delsol.PAPER]


def named(joint, family, *alternatives):
    return Named(joint, family, "identified", alternatives, 2.0, 1.0)


def test_the_page_begins_with_every_false_name():
    """The arms are in the order of the families: Dahl, a loop, falling with speed, then others."""
    arms = [
        (named(1, "spring.position"), named(3, "hysteresis.presliding")),
        (named(3, "coupling.kinematic"), named(2, "unknown")),
        (named(1, "spring.end_stop", "spring.position"), named(2, "friction.stribeck")),
    ]
    arms += [()] * (len(FAMILIES) - len(arms) - 1) + [(named(2, "friction.stribeck"),)]
    same = (delsol.Outcome((1.0,) * 5, 1.0, 1.0, 1.0),) * len(FAMILIES)
    outcomes = dict.fromkeys((delsol.PAPER, delsol.DISCARDED, delsol.OURS), same)
    study = DelSolStudy("", 1, outcomes, tuple(arms), Provenance.now(0))
    said = page(study).paragraphs[0]
    assert f"joint 1 of 1 of {len(FAMILIES)} arms" in said
    assert f"Of 7 names on {5 * len(FAMILIES)} joints 2 are false" in said
    assert "coupling.kinematic on joint 3, friction.stribeck on joint 2" in said


def test_the_excitation_keeps_to_table_1():
    motions = delsol.swings(np.random.default_rng(0))
    assert len(motions) == 5 * delsol.SWINGS * delsol.POSES
    for k, motion in enumerate(motions):
        joint = k // (delsol.SWINGS * delsol.POSES)
        moving = np.ptp(motion.position, axis=0) > 1e-9
        assert list(np.flatnonzero(moving)) == [joint]
        lowest, highest = delsol.TABLE_1_HZ[joint]
        frequency = 2 / (len(motion) * motion.period_s)
        assert 0.98 * lowest <= frequency <= 1.03 * highest
