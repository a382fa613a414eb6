"""The master's driver on its fake, and three motors that follow it in position."""

import numpy as np
import pytest

from drivers.teensy.driver import TeensyLogger
from drivers.teensy.fake import TeensyFake
from drivers.teensy.grasper import GRASPER, GrasperLimits
from drivers.teensy.grasper_guard import GRASPER_LOGIC
from drivers.teensy_master.fake import MIDDLE, REACH, TurnedByHand, open_fake
from drivers.transport.faulty import Faults
from drivers.transport.simulated import SimulatedTransport
from rig.grasper.coupling import GrasperError
from rig.grasper.follow import follow
from rig.live.grasper import master

RAD_PER_COUNT = np.full(3, 2 * np.pi / 2048)
GAINS = np.array([[2.0, 0.0, 0.0, 0.5, 3000.0]] * 3)


def armed_board():
    """A grasper's board in virtual time, armed with gains and the widest limits."""
    fake = TeensyFake(TurnedByHand(), logic=GRASPER_LOGIC)
    link = SimulatedTransport(fake, "sim://grasper", tick_s=GRASPER.tick_us * 1e-6)
    board = TeensyLogger(link, GRASPER)
    board.identify()
    board.arm(GAINS, GrasperLimits())
    board.start()
    return board


@pytest.fixture
def chief():
    device = open_fake(Faults())
    device.start()
    yield device
    device.close()


def test_the_potentiometers_come_in_counts_at_2_khz(chief):
    assert [c.name for c in chief.channels] == ["yaw_count", "pitch_count", "grasp_count"]
    assert {c.rate_hz for c in chief.channels} == {2000.0}
    batches = [chief.read(0.1) for _ in range(40)]
    yaw = np.concatenate([batch.columns["yaw_count"] for batch in batches])
    assert yaw.max() == pytest.approx(MIDDLE + REACH, abs=2)
    assert np.abs(np.diff(yaw)).max() <= 1


def test_three_motors_are_sent_where_the_master_is(chief):
    board = armed_board()
    asked = []
    read = chief.read

    def remembered(timeout_s):
        batch = read(timeout_s)
        asked.append(np.column_stack(list(batch.columns.values())))
        return batch

    chief.read = remembered
    following = follow(chief, master(), board, RAD_PER_COUNT)
    samples = [next(following).samples for _ in range(30)]
    following.close()
    counts = np.concatenate(asked)
    expected = np.round(master().motor_rad(counts) / RAD_PER_COUNT)
    played = np.concatenate(
        [np.column_stack([s[f"target_{k}"] for k in (1, 2, 3)]) for s in samples]
    )
    moved = played[np.any(played != 0, axis=1)]
    assert len(moved) > 200
    # each setpoint is one of those asked for, in their order
    begin = int(np.flatnonzero((expected == moved[0]).all(axis=1))[0])
    np.testing.assert_array_equal(moved[:200], expected[begin : begin + 200])


def test_a_broken_wire_disarms_the_motors(chief):
    board = armed_board()
    read = chief.read

    def broken(timeout_s):
        batch = read(timeout_s)
        batch.columns["pitch_count"][:] = 0
        return batch

    chief.read = broken
    with pytest.raises(GrasperError, match="rail"):
        for _ in follow(chief, master(), board, RAD_PER_COUNT):
            pass
    assert not (board.read(0.05).samples["status"][-1] & 1)
