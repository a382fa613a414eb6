"""An arm's joints as balances of a diagnosis, on simulated arms whose hidden friction is known."""

from dataclasses import replace

import numpy as np
import pytest

from estimation.arm.balances import balances_of
from estimation.arm.kinematics import ArmError
from estimation.arm.motion import motion_of
from estimation.arm.shared import laid_out, shared_fit
from estimation.causes.verdict import diagnose
from estimation.diagnosis.split import split
from estimation.recording import Recording
from rig.arm.simulated import RATE_HZ, draw_arm, excitation, recorded, simulate

pytestmark = pytest.mark.integration

pytest.importorskip("pinocchio", reason="Pinocchio is not installed (extra arm)")


def campaign(presliding_on: int | None, runs: int = 9, seconds: float = 15.0) -> list[Recording]:
    """Runs of one arm; hidden friction with memory on one joint, from 1, or on none."""
    rng = np.random.default_rng(7)
    arm = draw_arm(rng)
    hidden = np.zeros_like(arm.hidden)
    if presliding_on is not None:
        hidden[0, presliding_on - 1] = arm.hidden[0, presliding_on - 1]
    arm = replace(arm, hidden=hidden)
    made = []
    for k in range(runs):
        run = simulate(arm, excitation(rng, seconds), rng)
        made.append(recorded(f"run {k}", run.position, run.torque, RATE_HZ))
    return made


def positions(run: Recording) -> np.ndarray:
    return np.column_stack([run[names.position] for names in balances_of(run).joints])


def diagnosed(recordings: list[Recording], *joints: int):
    arm, sealed = balances_of(recordings[0]), split(recordings, 0)
    whole = laid_out(arm, recordings, sealed.discover)
    models = [arm.models[j - 1] for j in joints]
    return diagnose(whole, models, sealed)


def test_hidden_friction_is_named_on_its_joint_and_on_no_other() -> None:
    found = diagnosed(campaign(presliding_on=2), 1, 2)
    (finding,) = found.findings
    # Dahl's friction is presliding, and the Bouc-Wen loop with its sharpest corner
    assert finding.family in ("hysteresis.presliding", "hysteresis.bouc_wen")
    assert finding.balance == "joint.2"
    assert finding.runs_improved == finding.runs_total == 3
    assert found.errors["joint.2"].after < 0.2 * found.errors["joint.2"].before
    assert "history" in finding.depends_on


def test_an_arm_with_a_complete_model_gets_no_finding() -> None:
    assert diagnosed(campaign(presliding_on=None), 2, 3).verdict == "nothing_missing"


def test_the_links_share_one_set_of_parameters_over_all_joints() -> None:
    (run,) = campaign(None, runs=1, seconds=30.0)
    arm = balances_of(run)
    (whole,) = laid_out(arm, [run], {run.name})
    fitted = shared_fit(arm, [run])
    declared = arm.columns(motion_of(positions(run), 1 / RATE_HZ)) @ fitted.values
    for k, names in enumerate(arm.joints[:3]):
        left = (whole[names.torque] - declared[:, k])[200:-200]
        assert np.std(left) < 0.05 * np.std(whole[names.torque])
        assert 0 < np.std(whole[names.links]) < 2 * np.std(whole[names.torque])
    with pytest.raises(ArmError, match="Record longer runs"):
        shared_fit(arm, [run.at(np.arange(120))])
