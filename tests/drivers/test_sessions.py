"""Who may move a board: sessions, sequence numbers, and trips that are cleared by name."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.teensy import protocol
from drivers.teensy.core import BoardStart, FirmwareBoard
from drivers.teensy.fake import PythonBoard
from drivers.teensy.protocol import Kind, Result, Trip
from drivers.teensy.reference import Limits
from drivers.transport.simulated import Board
from tests.drivers.bench_physics import START_SPINDLE, PlainBench, ScriptedBench
from tests.drivers.raw_host import GAINS, RawHost

QUICK = Limits(watchdog_us=100_000)
HERE = START_SPINDLE


@pytest.fixture(params=["plain", "core"])
def board(request: pytest.FixtureRequest) -> Board:
    """A board on its bench: the plain simulated one, and the compiled core."""
    if request.param == "plain":
        return PythonBoard(PlainBench())
    return FirmwareBoard(PlainBench(), library=request.getfixturevalue("library"))


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
    "a ping without the session": lambda h: protocol.encode_ping(h.next_number(), 1, 0),
    "a ping of the next session": lambda h: protocol.encode_ping(
        h.next_number(), 1, h.hello().offer
    ),
    "an old ping": lambda h: protocol.encode_ping(1, 1, h.session),
    "a hello": lambda h: protocol.encode_command(Kind.HELLO, h.next_number()),
    "the question for its trip": lambda h: protocol.encode_command(Kind.TRIP, h.next_number()),
    "a start": lambda h: protocol.encode_command(Kind.START, h.next_number()),
    "setpoints of another session": lambda h: h.profile.encode_setpoints(
        h.next_number(), (np.array([HERE]), np.array([0])), h.session ^ 1
    ),
    "a refused arming": lambda h: h.profile.encode_arm(h.next_number(), GAINS[None], QUICK, 7),
}


@pytest.mark.parametrize("name", list(NO_SIGN_OF_LIFE))
def test_only_the_session_that_armed_keeps_a_board_armed(board: Board, name: str) -> None:
    host = moving_host(board)
    for _ in range(30):
        host.run(5)
        host.send(NO_SIGN_OF_LIFE[name](host))
    assert host.trip().code is Trip.HOST_SILENT


def test_pings_and_setpoints_of_the_session_keep_it_armed(board: Board) -> None:
    host = moving_host(board)
    for _ in range(20):
        host.run(50)
        host.ping()
    for _ in range(20):
        host.run(50)
        assert host.setpoints([HERE], [0]) is Result.OK
    assert host.armed


def test_a_monitor_does_not_keep_a_killed_hosts_board_armed(board: Board) -> None:
    host = moving_host(board)
    monitor = RawHost(board)
    monitor.hello()
    for _ in range(8):
        monitor.run(20)
        monitor.ping()
    assert host.trip().code is Trip.HOST_SILENT


def test_a_second_host_neither_moves_nor_takes_over_an_armed_board(board: Board) -> None:
    moving_host(board)
    second = RawHost(board)
    assert second.setpoints([HERE], [0]) is Result.WRONG_SESSION
    assert second.arm() is Result.ALREADY_ARMED
    assert second.setpoints([HERE], [0]) is Result.WRONG_SESSION


def test_bytes_of_an_earlier_arming_neither_arm_nor_move(board: Board) -> None:
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


def test_a_late_duplicate_of_arming_does_not_undo_a_disarming(board: Board) -> None:
    host = RawHost(board)
    arm = host.arm_payload()
    assert host.ack(arm)[0] is Result.OK
    assert host.command(Kind.DISARM) is Result.OK
    assert host.ack(arm)[0] is Result.WRONG_SESSION
    assert not host.armed


def test_setpoints_that_come_twice_or_late_are_not_queued(board: Board) -> None:
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


def test_sequence_numbers_may_wrap(board: Board) -> None:
    host = RawHost(board)
    host.number = 2**16 - 3
    assert host.arm() is Result.OK
    for _ in range(5):
        assert host.setpoints([HERE], [0]) is Result.OK


def test_a_trip_is_cleared_by_its_name_alone(board: Board) -> None:
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


def test_offers_differ_between_starts_of_a_board(library: object) -> None:
    offers = set()
    for boot in range(1, 40):
        host = RawHost(FirmwareBoard(PlainBench(), BoardStart(boot=boot)))
        for _ in range(5):
            offers.add(host.hello().offer)
            assert host.arm() is Result.OK
            host.command(Kind.DISARM)
    assert len(offers) == 39 * 5


# what a line, a second program or an attacker may send: old frames, in any order, cut or whole
MIN_SPINDLE, MAX_SPINDLE = 900, 1800
OWN = Limits(
    min_spindle=MIN_SPINDLE,
    max_spindle=MAX_SPINDLE,
    max_load_ma=400,
    max_current=1500,
    watchdog_us=50_000,
    dry_ticks=60,
    hold_ticks=100,
)
numbers = st.integers(0, 6)
sessions = st.sampled_from(["offer", "live", "zero", "old"])
steps = st.one_of(
    st.tuples(st.just("arm"), sessions, st.booleans()),
    st.tuples(st.just("move"), sessions, st.integers(-3000, 5000), st.integers(-900, 900)),
    st.tuples(st.just("ping"), sessions),
    st.tuples(st.just("clear"), st.integers(0, 21)),
    st.tuples(st.just("plain"), st.sampled_from([Kind.START, Kind.STOP, Kind.DISARM, Kind.HELLO])),
    st.tuples(st.just("again"), st.integers(0, 40)),
    st.tuples(st.just("bytes"), st.binary(max_size=40)),
    st.tuples(st.just("run"), st.integers(1, 80)),
    st.tuples(st.just("stop"), st.booleans()),
)


class Adversary:
    """Plays steps against a core with limits of its own and keeps what must hold."""

    def __init__(self) -> None:
        inputs = np.zeros((1, 7), np.int32)
        inputs[:, 1] = HERE
        self.bench = ScriptedBench(inputs)
        self.board = FirmwareBoard(self.bench, own=([0, 0, 0, 0, 3000], OWN))
        self.host = RawHost(self.board, gains=[20.0, 0.05, -1.0, 0.2, 3000.0])
        self.host.command(Kind.START)
        self.sent: list[bytes] = []
        self.live: int | None = None
        self.old = 1

    def session(self, which: str) -> int:
        if which == "offer":
            return self.host.hello().offer
        return {"live": self.live or 0, "zero": 0, "old": self.old}[which]

    def step(self, step: tuple) -> None:
        before = self.host.armed
        what = step[0]
        payload = b""
        offer = self.host.hello().offer
        if what == "arm":
            wide = Limits(watchdog_us=OWN.watchdog_us)
            session = self.session(step[1])
            payload = self.host.arm_payload(wide if step[2] else OWN, session)
        elif what == "move":
            self.host.session = self.session(step[1])
            payload = self.host.setpoints_payload([step[2]] * 3, [step[3]] * 3)
        elif what == "ping":
            number = self.host.next_number()
            payload = protocol.encode_ping(number, 0, self.session(step[1]))
        elif what == "clear":
            payload = protocol.encode_clear(self.host.next_number(), step[1])
        elif what == "plain":
            payload = protocol.encode_command(step[1], self.host.next_number())
        elif what == "again" and self.sent:
            payload = self.sent[step[1] % len(self.sent)]
        elif what == "bytes":
            self.host.send(step[1])
        elif what == "run":
            self.host.run(step[1])
        elif what == "stop":
            self.board.stop(step[1])
        if payload:
            self.host.send(payload)
        after = self.host.armed
        if after and not before:
            is_arm = payload[1:2] == bytes([Kind.ARM])
            assert is_arm, step
            assert payload[4:8] == offer.to_bytes(4, "little"), step
            assert payload not in self.sent, "bytes that were sent before have armed the board"
            self.old, self.live = self.live or 1, offer
        if payload:
            self.sent.append(payload)

    def judge(self) -> None:
        samples = self.host.samples()
        assert (np.abs(samples["command_e4"].astype(int)) <= 3000).all()
        assert (np.abs(samples["load_ma"].astype(int)) <= 400).all()
        asked = samples["command_e4"] != 0
        assert (samples["target"][asked] >= MIN_SPINDLE).all()
        assert (samples["target"][asked] <= MAX_SPINDLE).all()
        force = protocol.STATUS_ARMED | protocol.STATUS_HOLDING
        out = (samples["status"] & force) == 0
        assert not samples["command_e4"][out].any()
        assert not samples["load_ma"][out].any()


@settings(max_examples=60)
@given(st.lists(steps, max_size=60))
def test_no_sequence_arms_without_a_live_session_or_moves_beyond_the_boards_limits(
    library: object, script: list[tuple]
) -> None:
    adversary = Adversary()
    for step in script:
        adversary.step(step)
    adversary.judge()


@pytest.mark.long
@pytest.mark.timeout(3600)
@settings(max_examples=5_000)
@given(st.lists(steps, min_size=20, max_size=60))
def test_no_sequence_of_many_does_either(library: object, script: list[tuple]) -> None:
    adversary = Adversary()
    for step in script:
        adversary.step(step)
    adversary.judge()
