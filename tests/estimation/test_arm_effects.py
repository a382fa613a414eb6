"""Effects of an arm: hysteresis with memory, and the wrist's motors behind their coupling."""

import numpy as np

from estimation.arm.effects import row_count, slip
from estimation.arm.motion import motion_of
from estimation.arm.signed import Block, Normal, Products, solve
from estimation.arm.tables import PSM
from estimation.arm.wrist import candidates

PERIOD_S = 0.005


def test_an_elastic_slip_element_turns_within_twice_its_threshold():
    there_and_back = np.concatenate([np.linspace(0, 1, 101), np.linspace(0.99, 0.8, 20)])
    stretch = slip(there_and_back[:, None], 0.05)[:, 0]
    assert np.isclose(stretch[5], 1.0)  # slips at its threshold
    assert stretch[100] == 1.0
    assert np.isclose(stretch[105], 0.0)  # relaxed one threshold after the turn
    assert np.isclose(stretch[110], -1.0)  # slips the other way two thresholds after it
    assert np.isclose(stretch[-1], -1.0)


def wave() -> np.ndarray:
    time = np.arange(0, 4, PERIOD_S)[:, None]
    return 0.3 * np.sin((1 + np.arange(7)) * time)


def test_every_candidate_gives_finite_columns_that_differ():
    motion = motion_of(wave(), PERIOD_S)
    tables = [effect.columns(motion) for effect in candidates(PSM)]
    assert len({effect.name for effect in candidates(PSM)}) == len(tables)
    for table in tables:
        assert table.shape[:2] == (len(motion), row_count(PSM))
        assert np.isfinite(table).all()
        assert np.abs(table).max() > 0  # of a track, most knots are not visited


def test_the_wrists_drives_do_the_work_that_its_joints_do():
    motion = motion_of(wave(), PERIOD_S)
    (damping,) = (e for e in candidates(PSM) if e.name == "wrist drive damping")
    coupling = np.array(PSM.wrist_coupling)
    torque = damping.columns(motion)  # N m per N m s of each drive
    drive_speed = np.linalg.solve(coupling, motion.velocity[:, 4:7].T).T
    for drive in range(3):
        power = np.sum(torque[:, :, drive] * motion.velocity[:, :7], axis=1)
        np.testing.assert_allclose(power, drive_speed[:, drive] ** 2, atol=1e-12)


def test_dissipative_parameters_are_never_negative_and_others_are_least_squares():
    rng = np.random.default_rng(3)
    columns, truth = rng.normal(size=(200, 2, 4)), np.array([2.0, -1.0, 0.5, -0.3])
    torque = columns @ truth
    products, weights = Products.of(columns, torque), np.array([1.0, 2.0])
    normal = Normal.of(products, weights)

    def found(signs):
        return solve(normal, [Block("all", np.arange(4), np.array(signs), 0.0, own_length=True)])

    np.testing.assert_allclose(found([False] * 4), truth, atol=1e-10)
    bounded = found([True, False, True, True])
    assert bounded[3] == 0.0
    assert np.all(bounded[[0, 2]] > 0)
    left = torque - columns @ bounded
    expected = np.sqrt(np.mean(left**2, axis=0))
    np.testing.assert_allclose(products.rms(np.arange(4), bounded), expected, rtol=1e-9)
