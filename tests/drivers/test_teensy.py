"""The logger's driver, on the fake and on the firmware core; its layouts."""

import itertools
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from drivers.errors import (
    CommandRefusedError,
    DisarmUnconfirmedError,
    DriverError,
    FrameError,
    LinkLostError,
    LinkTimeoutError,
    ProtocolMismatchError,
)
from drivers.framing import encode_frame
from drivers.teensy import protocol
from drivers.teensy.core import BoardStart, FirmwareBoard
from drivers.teensy.driver import SampleBatch, TeensyLogger
from drivers.teensy.fake import PythonBoard
from drivers.teensy.protocol import Kind, Result
from drivers.teensy.reference import REFERENCE, SAMPLE_DTYPE, SETPOINT_DTYPE, Limits
from drivers.transport.faulty import FaultyTransport, unchanged
from drivers.transport.simulated import Board, SimulatedTransport
from rig.simulation.bench import SimulatedBench
from tests.drivers.taps import once

GAINS = [20.0, 0.05, -1.0, 0.2, 10000.0]
WIDEST = Limits()
START_SPINDLE = 1366

MakeBoard = Callable[..., Board]
Wired = tuple[FaultyTransport, TeensyLogger]


@pytest.fixture(params=["fake", "firmware"])
def make_board(request: pytest.FixtureRequest) -> MakeBoard:
    """A board on its bench: the Python fake, and the firmware core."""
    if request.param == "fake":
        return lambda tick_us=0: PythonBoard(SimulatedBench(), tick_us)
    library = request.getfixturevalue("library")
    return lambda tick_us=0: FirmwareBoard(SimulatedBench(), BoardStart(tick_us=tick_us), library)


def wire(board: Board) -> Wired:
    cable = FaultyTransport(SimulatedTransport(board))
    return cable, TeensyLogger(cable)


@pytest.fixture
def wired(make_board) -> Iterator[Wired]:
    """The cable to a board, and its logger, which streams."""
    cable, logger = wire(make_board())
    logger.start()
    yield cable, logger
    cable.incoming = unchanged
    logger.close()


def read_for(logger: TeensyLogger, ticks: int, beat: bool = True) -> list[SampleBatch]:
    """Read until `ticks` samples have come."""
    batches: list[SampleBatch] = []
    while sum(len(batch.samples) for batch in batches) < ticks:
        if beat:
            logger.heartbeat()
        batches.append(logger.read(0.1))
        assert len(batches[-1].samples), "the stream has dried up"
    return batches


def samples_of(logger: TeensyLogger, ticks: int, beat: bool = True) -> np.ndarray:
    return np.concatenate([batch.samples for batch in read_for(logger, ticks, beat)])


def test_a_session_moves_the_spindle_and_ends_disarmed(wired):
    _, logger = wired
    identity = logger.identify()
    assert (identity.serial, identity.protocol_hash) == ("SIM-0001", REFERENCE.protocol_hash)
    rest = samples_of(logger, 100)
    assert (rest["status"] == protocol.STATUS_REFERENCED).all()
    assert not rest["command_e4"].any()
    logger.arm(GAINS, WIDEST)
    targets = START_SPINDLE - np.arange(600)
    assert logger.queue(targets, np.full(600, 200)) == protocol.QUEUE_CAPACITY - 600
    played = samples_of(logger, 600)
    armed = played[(played["status"] & protocol.STATUS_ARMED) != 0]
    assert np.array_equal(armed["target"][:600], targets)
    assert set(armed["load_ma"][:600]) == {200}
    assert abs(int(armed["spindle"][599]) - int(targets[599])) < 60
    logger.disarm()
    logger.read(0.0)
    after = samples_of(logger, 50)
    assert (after["status"] == protocol.STATUS_REFERENCED).all()
    assert not after["command_e4"].any()
    assert not after["load_ma"].any()
    logger.stop()
    counters = logger.counters
    assert (counters.lost, counters.crc_errors, counters.retries, counters.gaps) == (0, 0, 0, 0)
    assert counters.frames >= 750


def test_samples_are_numbered_and_the_clock_is_unwrapped(make_board):
    start_us = 2**32 - 120_000
    _, logger = wire(make_board(start_us))
    logger.start()
    batches = read_for(logger, 300)
    numbers = np.concatenate([batch.samples["sequence"] for batch in batches])
    ticks = np.concatenate([batch.tick_us for batch in batches])
    assert np.array_equal(numbers, np.arange(len(numbers)))
    assert np.array_equal(ticks, start_us + 1000 * np.arange(len(ticks)))
    looked = logger.last_exchange
    assert looked.sent_s <= looked.received_s
    assert looked.tick_us % 2**32 in ticks % 2**32
    assert ticks.dtype == np.int64
    assert batches[-1].lost == 0
    logger.start()
    again = logger.read(0.1)
    assert (again.samples["sequence"][0], again.tick_us[0]) == (0, ticks[-1] + 1000)


def test_without_a_word_from_the_host_the_board_makes_itself_safe(wired):
    _, logger = wired
    logger.arm(GAINS, WIDEST)
    logger.queue(np.full(600, START_SPINDLE - 2000), np.full(600, 300))
    samples = samples_of(logger, 400, beat=False)
    silent = (samples["status"] & protocol.STATUS_WATCHDOG_TRIPPED) != 0
    assert np.flatnonzero(silent)[0] == 251
    assert silent[251:].all()
    assert samples["command_e4"][:251].all()
    assert not samples["command_e4"][251:].any()
    assert not samples["load_ma"][251:].any()
    with pytest.raises(CommandRefusedError, match="not armed") as refusal:
        logger.queue(np.array([0]), np.array([0]))
    assert refusal.value.code == Result.NOT_ARMED
    with pytest.raises(CommandRefusedError, match="rig clear"):
        logger.arm(GAINS, WIDEST)
    logger.clear(logger.trip().code)
    logger.arm(GAINS, WIDEST)
    fresh = samples_of(logger, 50)
    assert not (fresh["status"][-50:] & protocol.STATUS_WATCHDOG_TRIPPED).any()


def test_a_dry_queue_holds_the_last_target_and_reports_it(wired):
    _, logger = wired
    logger.arm(GAINS, WIDEST)
    idle = samples_of(logger, 50)
    assert ((idle["status"] & protocol.STATUS_QUEUE_DRY) != 0).all()
    assert not idle["command_e4"].any()
    assert np.array_equal(idle["target"], idle["spindle"])
    logger.queue(np.full(10, START_SPINDLE - 70), np.full(10, 5))
    samples = samples_of(logger, 50)
    dry = (samples["status"] & protocol.STATUS_QUEUE_DRY) != 0
    assert np.flatnonzero(dry)[0] == 10
    assert set(samples["target"]) == {START_SPINDLE - 70}
    assert set(samples["load_ma"]) == {5}


SETPOINTS = {
    "no number": ([np.nan], [0]),
    "no whole number": ([1.0], [0]),
    "a target beyond its type": ([2**31], [0]),
    "a load beyond its type": ([0], [2**15]),
    "unequal numbers": ([0, 1], [0]),
    "two dimensions": (np.zeros((2, 2), int), np.zeros((2, 2), int)),
}


@pytest.mark.parametrize("what", SETPOINTS)
def test_setpoints_are_whole_numbers_in_range(wired, what):
    _, logger = wired
    logger.arm(GAINS, WIDEST)
    with pytest.raises(DriverError):
        logger.queue(*map(np.array, SETPOINTS[what]))


# what can go wrong on the way


def test_another_protocol_is_refused_by_name_before_anything_moves_and_disarms():
    _, logger = wire(PythonBoard(SimulatedBench(), protocol_hash=0xDEADBEEF))
    words = f"deadbeef.*{REFERENCE.protocol_hash:08x}.*rig firmware flash"
    with pytest.raises(ProtocolMismatchError, match=words):
        logger.arm(GAINS, WIDEST)
    logger.disarm()


def test_a_hello_reply_of_another_layout_is_a_mismatch(wired):
    cable, logger = wired
    cable.incoming = once(lambda _: encode_frame(b"\x02\x02\x04\x00" + bytes(60)))
    with pytest.raises(ProtocolMismatchError, match="another layout"):
        logger.identify()


def test_a_half_frame_at_the_start_does_no_harm(make_board):
    board = make_board()
    board.receive(b"\x01\x02half a command of an earlier program")
    wire(board)[1].start()
    board.advance(40)
    board.transmit()
    cable, logger = wire(board)
    cable.incoming = once(lambda data: data[17:])
    board.advance(5)
    logger.identify()
    assert logger.counters.crc_errors == 0
    assert logger.counters.discarded_bytes == 46 - 17
    logger.start()
    assert logger.read(0.1).samples["sequence"][0] == 0
    assert logger.counters.lost == 0


def test_a_silent_board_is_a_timeout_after_the_retries(wired):
    cable, logger = wired
    cable.incoming = lambda _: b""
    with pytest.raises(LinkTimeoutError, match="sim://"):
        logger.identify()
    assert logger.counters.retries == 2


def test_a_lost_answer_does_not_carry_a_command_out_twice(wired):
    cable, logger = wired
    logger.arm(GAINS, WIDEST)
    cable.incoming = once(lambda _: b"")
    targets = START_SPINDLE - np.arange(30)
    logger.queue(targets, np.zeros(30, np.int64))
    assert logger.counters.retries == 1
    samples = samples_of(logger, 90)
    fed = (samples["status"] & protocol.STATUS_QUEUE_DRY) == 0
    assert np.array_equal(samples["target"][fed], targets)


def test_arming_is_not_believed_of_a_board_that_tripped_meanwhile(make_board):
    cable, logger = wire(make_board())
    logger.identify()
    came = itertools.count()
    cable.incoming = lambda data: b"" if data and next(came) == 1 else data  # behind the hello's
    with pytest.raises(CommandRefusedError, match="not any more"):
        logger.arm(GAINS, Limits(watchdog_us=50_000))
    assert logger.counters.retries == 1
    logger.close()


def test_lost_and_repeated_samples_are_counted_and_never_made_up(wired):
    cable, logger = wired
    first = logger.read(0.1)
    assert first.lost == 0

    def damage(data: bytes) -> bytes:
        frames = [data[k : k + 46] for k in range(0, len(data), 46)]
        changed = frames[3][:20] + bytes([frames[3][20] ^ 1 or 2]) + frames[3][21:]
        return b"".join([*frames[:3], changed, *frames[4:8], *frames[6:8], *frames[10:]])

    cable.incoming = once(damage)
    batch = logger.read(0.1)
    number = first.samples["sequence"][-1] + 1
    expected = [number + k for k in range(50) if k not in (3, 8, 9)]
    assert batch.samples["sequence"].tolist() == expected
    assert batch.lost == 3
    counters = logger.counters
    assert (counters.lost, counters.gaps, counters.duplicates) == (3, 2, 2)
    assert counters.crc_errors == 1
    assert counters.discarded_bytes in (45, 46)
    assert np.array_equal(np.diff(batch.tick_us), 1000 * np.diff(expected))
    assert logger.read(0.1).lost == 3


def test_frames_nobody_expected_are_counted(wired):
    cable, logger = wired
    strange = encode_frame(bytes(42)) + encode_frame(b"\x01\x63ab") + encode_frame(b"\x01\x10ab")
    cable.incoming = once(lambda data: strange + data)
    assert len(logger.read(0.1).samples) == 50
    assert logger.counters.unknown_frames == 3


def test_disarm_is_not_believed_without_an_answer(wired):
    cable, logger = wired
    logger.arm(GAINS, WIDEST)
    cable.incoming = lambda _: b""
    with pytest.raises(DisarmUnconfirmedError, match=r"not confirmed.*cut its supply"):
        logger.disarm()
    with pytest.raises(DisarmUnconfirmedError):
        logger.close()
    with pytest.raises(LinkLostError):
        cable.read(0.0)
    logger._may_be_armed = False


def test_disarm_is_not_believed_when_the_board_reports_that_it_is_armed(make_board):
    cable, logger = wire(make_board())
    logger.arm(GAINS, WIDEST)

    def still_armed(data: bytes) -> bytes:
        fields = (protocol.Kind.DISARM, Result.OK, protocol.STATUS_ARMED, 0)
        return encode_frame(protocol.encode(protocol.Kind.ACK, 3, *fields)) if data else data

    cable.incoming = still_armed
    with pytest.raises(DisarmUnconfirmedError, match="still armed"):
        logger.disarm()


def test_leaving_the_with_block_disarms(make_board):
    board = make_board()
    with pytest.raises(ZeroDivisionError), wire(board)[1] as logger:  # noqa: PT012
        logger.arm(GAINS, WIDEST)
        raise ZeroDivisionError
    with wire(board)[1] as logger:
        logger.start()
        assert (logger.read(0.1).samples["status"] == protocol.STATUS_REFERENCED).all()


ROOT = Path(__file__).parents[2]


def test_the_sample_is_laid_out_as_documented_and_no_other_frame_has_its_size():
    layout = SAMPLE_DTYPE
    assert layout.itemsize == 42
    offsets = {name: layout.fields[name][1] for name in layout.names}
    assert list(offsets.values()) == [0, 1, 2, 4, 8, 12, 16, 20, 24, 28, 30, 32, 34, 36, 38, 40]
    assert all(layout[name].str[0] in "<|" for name in layout.names)
    others = [item.itemsize for kind, item in REFERENCE.layouts.items() if kind != Kind.SAMPLE]
    assert 42 not in others
    assert (42 - 4) % SETPOINT_DTYPE.itemsize


def test_an_unknown_trip_is_refused():
    fields = REFERENCE.decode(protocol.encode(Kind.TRIP_REPORT, 1, 99, 255, 0, 0, 0, 0))[2]
    with pytest.raises(FrameError, match="99"):
        REFERENCE.decode_trip_report(fields)


@pytest.mark.parametrize(
    "payload",
    [
        b"\x01\x10\x00",
        b"\x02\x10\x00\x00",
        b"\x01\x63\x00\x00",
        b"\x01\x10\x00\x00\x00",
        protocol.encode(Kind.SETPOINTS, 1, 0),
        protocol.encode(Kind.SETPOINTS, 1, 0) + bytes(5),
        protocol.encode(Kind.SETPOINTS, 1, 0) + bytes(606),
        bytes([1, Kind.SAMPLE]) + bytes(40),
    ],
    ids=["short", "version", "kind", "long", "none", "part", "many", "sample"],
)
def test_anything_else_is_refused(payload):
    with pytest.raises(FrameError):
        REFERENCE.decode(payload)


def test_the_boards_header_is_the_one_made_from_these_tables():
    done = subprocess.run(
        [sys.executable, "-c", "import contract; print(contract.header(), end='')"],
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "firmware")])},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout == (ROOT / "firmware" / "core" / "contract.hpp").read_text()
