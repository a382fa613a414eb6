"""Effects of an arm: hysteresis with memory, and the wrist's motors behind their coupling."""

import numpy as np

from estimation.arm.effects import candidates, slip
from estimation.arm.motion import motion_of
from estimation.arm.tables import PSM

PERIOD_S = 0.005


def test_an_elastic_slip_element_turns_within_twice_its_threshold():
    there_and_back = np.concatenate([np.linspace(0, 1, 101), np.linspace(0.99, 0.8, 20)])
    stretch = slip(there_and_back[:, None], 0.05)[:, 0]
    assert np.isclose(stretch[5], 1.0)  # slips at its threshold
    assert stretch[100] == 1.0
    assert np.isclose(stretch[105], 0.0)  # relaxed one threshold after the turn
    assert np.isclose(stretch[110], -1.0)  # slips the other way two thresholds after it
    assert np.isclose(stretch[-1], -1.0)


def test_its_loop_does_not_depend_on_speed():
    angle = np.sin(np.linspace(0, 12, 4001))
    slow, fast = slip(angle[:, None], 0.2)[::4], slip(angle[::4, None], 0.2)
    np.testing.assert_allclose(slow, fast, atol=0.02)


def wave() -> np.ndarray:
    time = np.arange(0, 4, PERIOD_S)[:, None]
    return 0.3 * np.sin((1 + np.arange(7)) * time)


def test_every_candidate_gives_finite_columns_that_differ():
    motion = motion_of(wave(), PERIOD_S)
    tables = [effect.columns(motion) for effect in candidates(PSM)]
    assert len({effect.name for effect in candidates(PSM)}) == len(tables)
    for table in tables:
        assert table.shape[:2] == (len(motion), 6)
        assert np.isfinite(table).all()
        assert np.all(np.abs(table).max(axis=(0, 1)) > 0)


def test_the_wrists_drives_do_the_work_that_its_joints_do():
    motion = motion_of(wave(), PERIOD_S)
    (damping,) = (e for e in candidates(PSM) if e.name == "wrist drive damping")
    coupling = np.array(PSM.wrist_coupling)
    torque = damping.columns(motion)  # N m per N m s of each drive
    drive_speed = np.linalg.solve(coupling, motion.velocity[:, 4:7].T).T
    # the gripper held still: the joints' power is the drives'
    still = motion.velocity.copy()
    still[:, 6] = 0
    still_speed = np.linalg.solve(coupling, still[:, 4:7].T).T
    for drive in range(3):
        power = np.sum(torque[:, :, drive] * still[:, :6], axis=1)
        np.testing.assert_allclose(power, drive_speed[:, drive] * still_speed[:, drive], atol=1e-12)
