"""`rig study zhang`: seven joints on simulated arms, networks and physical model."""

import numpy as np
import pytest

from estimation.arm.wrist import candidates
from estimation.networks.training import Settings, has_torch
from rig.arm.hidden import FAMILIES
from rig.arm.simulated import draw_arm
from rig.studies.seeds import Keeper
from rig.studies.zhang import free as zhang_free
from rig.studies.zhang import networks as zhang_networks
from rig.studies.zhang import physics as zhang_physics
from rig.studies.zhang.psm import GRIPPER, KINDS, simulate, with_instrument
from rig.studies.zhang.psm_motion import LEAD_SAMPLES, moving_gripper, random_path, with_gripper
from rig.studies.zhang.study import PAPER, one_arm, run

pytestmark = pytest.mark.long

pytest.importorskip("pinocchio", reason="Pinocchio is not installed (extra arm)")
torch_only = pytest.mark.skipif(not has_torch(), reason="torch is not installed (extra learn)")


@pytest.fixture(scope="module")
def psm():
    rng = np.random.default_rng(0)
    return with_instrument(rng, draw_arm(rng), "CF")


def test_shown_torque_is_the_true_one_through_both_couplings(psm):
    motion = with_gripper(random_path(np.random.default_rng(1), 4.0), 0.3, 0.8)
    free, held = (
        simulate(psm, motion, np.random.default_rng(2), grip_n_m=grip, lead=LEAD_SAMPLES)
        for grip in (None, np.full(len(motion), 0.1))
    )
    leaked = np.mean(held.torque - free.torque, axis=0)
    expected = np.linalg.inv(psm.nominal_coupling).T @ psm.true_coupling.T @ [0, 0, 0, 0.1]
    np.testing.assert_allclose(leaked[4:], expected[1:], atol=1e-9)
    assert leaked[GRIPPER] == pytest.approx(0.1, rel=0.4)
    assert abs(leaked[5]) > 1e-4
    assert leaked[2] > 0.1
    np.testing.assert_allclose(leaked[:2], 0, atol=1e-9)


def test_states_are_causal(psm):
    run = simulate(
        psm, with_gripper(random_path(np.random.default_rng(6), 4.0), 0.1, 0.8),
        np.random.default_rng(7),
    )  # fmt: skip
    rows = zhang_networks.states(run, ("q1 0", "q1 10", "v3 5"))
    np.testing.assert_array_equal(rows[20], [
        run.position[20, 0], run.position[10, 0], run.velocity[15, 2],
    ])  # fmt: skip
    np.testing.assert_array_equal(rows[0], [run.position[0, 0]] * 2 + [run.velocity[0, 2]])


def test_free_motion_identifies_the_error_of_the_coupling_matrix():
    rng = np.random.default_rng(1)
    psm = with_instrument(rng, draw_arm(rng), "CF")
    runs = []
    for gripper in (moving_gripper(rng, 60.0, psm.kind.open_rad), 0.0):
        motion = with_gripper(random_path(rng, 60.0), gripper, psm.kind.open_rad)
        runs.append(simulate(psm, motion, rng, lead=LEAD_SAMPLES))
    tried = [*candidates(psm.table), *zhang_physics.of_long_slips()]
    wanted = ("wrist drive hysteresis", "cable slip J7", "long slip J3")
    effects = [effect for effect in tried if effect.name in wanted]
    path = zhang_physics.prepared("coupled", psm.table, runs, effects)
    values = path.values([effect.name for effect in effects])
    base = zhang_physics.base_block(1.0, zhang_physics.GRIPPER_FRICTIONS)
    declared = len(base.at)  # last of them the shares in joints 3 to 6
    true = psm.leak[1:3, 3] / psm.leak[3, 3]
    assert np.abs(true).min() > 0.1
    np.testing.assert_allclose(values[declared - 2 : declared], true, atol=0.02)


@torch_only
def test_the_command_does_all_experiments_and_goes_on_where_it_stopped(
    tmp_path, monkeypatch, answered
):
    monkeypatch.setattr(zhang_free, "MINUTES", 2.8)
    monkeypatch.setattr(zhang_free, "OTHER_MINUTES", (1.0, 0.3, 0.4))
    monkeypatch.setattr(zhang_free, "OUR_OTHER_MINUTES", 0.5)
    monkeypatch.setattr(zhang_networks, "SETTINGS", Settings(nodes=4, iterations=8))
    monkeypatch.setattr(zhang_networks, "TRANSFER", Settings(nodes=4, iterations=5))
    monkeypatch.setattr("rig.studies.seeds.in_processes", here)
    done = one_arm(0)
    monkeypatch.setattr("rig.studies.zhang.study.one_arm", lambda number: done)
    out, state = tmp_path / "zhang.md", tmp_path / "state"
    words = ("study zhang --seeds 1 --out", out, "--state", state, "--figures", tmp_path)
    found = answered(*words)
    assert len(found["outcomes"]) == len(FAMILIES)
    cells = found["outcomes"][0]
    networks, ours = (
        np.array(cells[f"I | M+C on M | {method}"])
        for method in (zhang_free.NETWORKS, zhang_free.OURS)
    )
    assert np.sum(ours < networks) >= 5
    assert "wrist drive hysteresis" in found["effects"]
    assert np.all(np.array(cells[f"I | C on M | {zhang_free.NETWORKS}"])[3:] > 1.2 * networks[3:])
    for name in KINDS:
        if name != "LND":
            before, after = (
                cells[f"II {when} | {name} | {zhang_free.NETWORKS}"][0]
                for when in ("before", "after")
            )
            assert after < before / 2
    assert "| M+C on M: paper | lost | lost | 6.11 | lost | lost | lost |" in out.read_text()
    assert (tmp_path / "zhang-grasp.svg").exists()
    monkeypatch.setattr("rig.studies.seeds.in_processes", nothing_left)
    again = run(1, Keeper(state))
    assert {cell: list(numbers) for cell, numbers in again.outcomes[0].items()} == cells
    assert set(PAPER) <= {cell.rsplit(" | ", 1)[0] for cell in cells}


def here(one_seed, seeds, workers, start):
    for seed in seeds:
        yield seed, one_seed(seed)


def nothing_left(one_seed, seeds, workers, start):
    assert seeds == []
    return iter(())
