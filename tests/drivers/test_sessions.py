"""Who may move a board: sessions, sequence numbers, and trips that are cleared by name."""

from collections.abc import Callable

import numpy as np
import pytest

from drivers.teensy import protocol
from drivers.teensy.core import BoardStart, FirmwareBoard
from drivers.teensy.fake import PythonBoard
from drivers.teensy.protocol import Kind, Result, Trip
from drivers.teensy.reference import Limits
from drivers.transport.simulated import Board
from rig.simulation.bench import SimulatedBench
from tests.drivers.raw_host import GAINS, RawHost

QUICK = Limits(watchdog_us=100_000)
HERE = 1366


@pytest.fixture(params=["plain", "core"])
def board(request: pytest.FixtureRequest) -> Board:
    """A board on its bench: the plain simulated one, and the compiled core."""
    if request.param == "plain":
        return PythonBoard(SimulatedBench())
    return FirmwareBoard(SimulatedBench(), library=request.getfixturevalue("library"))


def moving_host(board: Board) -> RawHost:
    """A host that streams and is armed, with a setpoint on its way."""
    host = RawHost(board)
    assert host.command(Kind.START) is Result.OK
    assert host.arm(QUICK) is Result.OK
    assert host.setpoints([HERE], [0]) is Result.OK
    return host


def own_samples(host: RawHost) -> bytes:
    sample = np.zeros(1, host.profile.sample)
    sample["version"], sample["kind"] = protocol.VERSION, Kind.SAMPLE
    return sample.tobytes()


NO_SIGN_OF_LIFE: dict[str, Callable[[RawHost], bytes]] = {
    "another version": lambda h: bytes([9, Kind.PING, 0, 0]) + bytes(12),
    "an unknown kind": lambda h: bytes([protocol.VERSION, 99, 0, 0]),
    "its own samples": own_samples,
    "a ping without the session": lambda h: protocol.encode(Kind.PING, h.next_number(), 0, 1),
    "a ping of the next session": lambda h: protocol.encode(
        Kind.PING, h.next_number(), h.hello().offer, 1
    ),
    "an old ping": lambda h: protocol.encode(Kind.PING, 1, h.session, 1),
    "a hello": lambda h: protocol.encode(Kind.HELLO, h.next_number()),
    "the question for its trip": lambda h: protocol.encode(Kind.TRIP, h.next_number()),
    "a start": lambda h: protocol.encode(Kind.START, h.next_number()),
    "setpoints of another session": lambda h: h.profile.encode_setpoints(
        h.next_number(), (np.array([HERE]), np.array([0])), h.session ^ 1
    ),
    "a refused arming": lambda h: h.profile.encode_arm(h.next_number(), GAINS[None], QUICK, 7),
}


@pytest.mark.parametrize("name", list(NO_SIGN_OF_LIFE))
def test_only_the_session_that_armed_keeps_a_board_armed(board, name):
    host = moving_host(board)
    for _ in range(30):
        host.run(5)
        host.send(NO_SIGN_OF_LIFE[name](host))
    assert host.trip().code is Trip.HOST_SILENT


def test_pings_and_setpoints_of_the_session_keep_it_armed(board):
    host = moving_host(board)
    for _ in range(20):
        host.run(50)
        host.ping()
    for _ in range(20):
        host.run(50)
        assert host.setpoints([HERE], [0]) is Result.OK
    assert host.armed


def test_a_monitor_does_not_keep_a_killed_hosts_board_armed(board):
    host = moving_host(board)
    monitor = RawHost(board)
    monitor.hello()
    for _ in range(8):
        monitor.run(20)
        monitor.ping()
    assert host.trip().code is Trip.HOST_SILENT


def test_a_second_host_neither_moves_nor_takes_over_an_armed_board(board):
    moving_host(board)
    second = RawHost(board)
    assert second.setpoints([HERE], [0]) is Result.WRONG_SESSION
    assert second.arm() is Result.ALREADY_ARMED
    assert second.setpoints([HERE], [0]) is Result.WRONG_SESSION


def test_bytes_of_an_earlier_arming_neither_arm_nor_move(board):
    host = RawHost(board)
    host.command(Kind.START)
    arm = host.arm_payload(QUICK)
    move = host.setpoints_payload([HERE] * 50, [0] * 50)
    assert host.ack(arm)[0] is Result.OK
    assert host.ack(move)[0] is Result.OK
    host.run(300)
    assert host.trip().code is Trip.HOST_SILENT
    for _ in range(2):
        for payload in (arm, move, arm):
            host.send(payload)
            host.run(5)
            assert not host.armed
        host.clear(Trip.HOST_SILENT)
    assert not host.samples()["command_e4"][-60:].any()


def test_a_late_duplicate_of_arming_does_not_undo_a_disarming(board):
    host = RawHost(board)
    arm = host.arm_payload()
    assert host.ack(arm)[0] is Result.OK
    assert host.command(Kind.DISARM) is Result.OK
    assert host.ack(arm)[0] is Result.WRONG_SESSION
    assert not host.armed


def test_setpoints_that_come_twice_or_late_are_not_queued(board):
    host = moving_host(board)
    earlier, later = (host.setpoints_payload([HERE] * 5, [0] * 5) for _ in range(2))
    assert host.ack(later)[0] is Result.OK
    assert host.ack(earlier)[0] is Result.OLD_SEQUENCE
    assert host.ack(later)[0] is Result.OLD_SEQUENCE
    newest = host.setpoints_payload([HERE] * 5, [0] * 5)
    for _ in range(3):  # its answer was lost: it is given again
        (answer,) = host.send(newest)
        ack = host.profile.decode(answer)[2]
        assert ack["result"] == Result.OK
        assert ack["queue_free"] == protocol.QUEUE_CAPACITY - 11


def test_sequence_numbers_may_wrap(board):
    host = RawHost(board)
    host.number = 2**16 - 3
    assert host.arm() is Result.OK
    for _ in range(5):
        assert host.setpoints([HERE], [0]) is Result.OK


def test_a_trip_is_cleared_by_its_name_alone(board):
    host = moving_host(board)
    host.run(300)
    assert host.arm() is Result.TRIPPED
    assert host.clear(Trip.NONE) is Result.WRONG_TRIP
    assert host.clear(Trip.STALLED) is Result.WRONG_TRIP
    assert host.arm() is Result.TRIPPED
    assert host.clear(Trip.HOST_SILENT) is Result.OK
    assert not host.armed
    assert host.arm() is Result.OK
    assert host.clear(Trip.NONE) is Result.ALREADY_ARMED


def test_offers_differ_between_starts_of_a_board(library):
    offers = set()
    for boot in range(1, 40):
        host = RawHost(FirmwareBoard(SimulatedBench(), BoardStart(boot=boot)))
        for _ in range(5):
            offers.add(host.hello().offer)
            assert host.arm() is Result.OK
            host.command(Kind.DISARM)
    assert len(offers) == 39 * 5
