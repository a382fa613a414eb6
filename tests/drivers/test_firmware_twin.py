"""The C++ core and the Python fake answer the same commands with the same bytes."""

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.framing import FrameStream, encode_frame
from drivers.teensy import protocol
from drivers.teensy.fake import PythonBoard
from drivers.teensy.firmware_fake import FirmwareBoard, FirmwareMissingError
from drivers.teensy.protocol import Kind, SafeState, Trip
from drivers.teensy.reference import REFERENCE, SAMPLE_DTYPE, Limits
from tests.drivers.bench_physics import PlainBench, ScriptedBench

GAINS = np.array([20.0, 0.05, -1.0, 0.2, 10000.0])
WIDEST = Limits.widest()
TIGHT = Limits(1500, 900, 5800, 30000, -4000, 4000)

Action = bytes | int
"""Bytes for the board, or ticks to advance."""


def command(kind: Kind, sequence: int) -> bytes:
    return encode_frame(protocol.encode_command(kind, sequence))


def arm(sequence: int, limits: Limits = WIDEST, gains: np.ndarray = GAINS) -> bytes:
    return encode_frame(REFERENCE.encode_arm(sequence, gains, limits))


def setpoints(sequence: int, targets: list[int], load_ma: int = 0) -> bytes:
    loads = np.full(len(targets), load_ma)
    return encode_frame(REFERENCE.encode_setpoints(sequence, (np.array(targets), loads)))


def ping(sequence: int, token: int) -> bytes:
    return encode_frame(protocol.encode_ping(sequence, token))


def sweep(start: int, count: int = 100) -> list[int]:
    return [round(1366 - 500 * np.sin((start + k) / 80)) for k in range(count)]


def answers(board: PythonBoard | FirmwareBoard, script: list[Action]) -> list[bytes]:
    """Run a script and return the bytes the board gave after each action."""
    given_bytes = []
    for action in script:
        if isinstance(action, bytes):
            board.receive(action)
        else:
            board.advance(action)
        given_bytes.append(board.transmit())
    return given_bytes


def assert_twins(
    script: list[Action],
    library: Path,
    start_tick_us: int = 0,
    make_bench: Callable[[], PlainBench | ScriptedBench] = PlainBench,
) -> bytes:
    """Run a script on both and return the bytes they agree on."""
    board = FirmwareBoard(make_bench(), start_tick_us=start_tick_us, library=library)
    core = answers(board, script)
    fake = answers(
        PythonBoard(make_bench(), start_tick_us=start_tick_us, build_hash=board.build_hash), script
    )
    for index, (ours, theirs) in enumerate(zip(fake, core, strict=True)):
        assert ours == theirs, f"action {index}: {script[index]!r}"
    return b"".join(fake)


def statuses(data: bytes) -> set[int]:
    frames = FrameStream(SAMPLE_DTYPE.itemsize).feed(data)
    assert frames.bad == 0
    return set(np.unique(frames.payloads.view(SAMPLE_DTYPE)["status"]).tolist())


def assert_tripped(data: bytes, trip: Trip) -> None:
    latch = (
        protocol.STATUS_WATCHDOG_TRIPPED
        if trip is Trip.HOST_SILENT
        else protocol.STATUS_LIMIT_TRIPPED
    )
    assert any(s >> protocol.TRIP_SHIFT == trip and s & latch for s in statuses(data))


def test_a_whole_session(library: Path) -> None:
    script: list[Action] = [command(Kind.HELLO, 1), command(Kind.START, 2), 30, arm(3), 5]
    script += [setpoints(4, sweep(0)), setpoints(5, sweep(100), 300), 150, ping(6, 2**63 + 5), 100]
    script += [setpoints(7, sweep(200)), 40, command(Kind.DISARM, 8), 20, command(Kind.STOP, 9), 10]
    seen = statuses(assert_twins(script, library, start_tick_us=2**32 - 100_000))
    assert seen == {0, protocol.STATUS_ARMED, protocol.STATUS_ARMED | protocol.STATUS_QUEUE_DRY}


def test_the_watchdog(library: Path) -> None:
    script: list[Action] = [command(Kind.HELLO, 1), command(Kind.START, 2), arm(3)]
    script += [setpoints(4, sweep(0)), 249, ping(5, 0), 250, 1, 1, 10, setpoints(6, sweep(0))]
    script += [arm(7), 5]
    assert_tripped(assert_twins(script, library), Trip.HOST_SILENT)


@pytest.mark.parametrize("limits", [TIGHT, Limits(2**31 - 1, 900, 2**31 - 1, 2**31 - 1, 0, 1400)])
def test_a_limit(library: Path, limits: Limits) -> None:
    far = [limits.min_spindle] * 100
    script: list[Action] = [command(Kind.HELLO, 1), command(Kind.START, 2), arm(3, limits)]
    script += [setpoints(4, far), 100, setpoints(5, far), 30, arm(6, limits), 3]
    seen = statuses(assert_twins(script, library))
    assert any(status & protocol.STATUS_LIMIT_TRIPPED for status in seen)


def test_saturation_and_a_host_that_does_not_read(library: Path) -> None:
    script: list[Action] = [command(Kind.START, 2), arm(3), setpoints(4, [-5000] * 100, 20000)]
    script += [ping(5, 0), 240, ping(6, 0), 240]
    seen = statuses(assert_twins(script, library))
    assert any(status & protocol.STATUS_SATURATED for status in seen)
    data = assert_twins([command(Kind.START, 2), 3000, 5, 1500, 1], library)
    last = FrameStream(42).feed(data).payloads[-1:].view(SAMPLE_DTYPE)[0, 0]
    assert last["dropped"] > 1000
    assert last["sequence"] == 4505


EDGES = {
    "motor": [0],
    "spindle": [-4001, -4000, 4000, 4001],
    "jaw": [-(2**31) + 1, 2**31 - 1],
    "proximal": [-32769, -32768, -32767, -5801, -5800, 5800, 5801, 32766, 32767, 32768],
    "distal": [-32769, -32768, -32767, -30001, -30000, 30000, 30001, 32767],
    "current": [-32768, -1501, -1500, 1500, 1501, 32766, 32767],
    "fsr": [-1, 4094, 4095, 4096, 65536],
}


@pytest.mark.parametrize("limits", [WIDEST, TIGHT], ids=["widest", "tight"])
@pytest.mark.parametrize("channel", list(EDGES))
def test_the_edges_of_every_channel(library: Path, channel: str, limits: Limits) -> None:
    seen = set()
    for value in EDGES[channel]:
        inputs = np.zeros((4, 7), np.int32)
        inputs[2, list(EDGES).index(channel)] = value
        script = [command(Kind.START, 1), arm(2, limits), setpoints(3, [0] * 9), 6]
        data = assert_twins(script, library, make_bench=lambda inputs=inputs: ScriptedBench(inputs))
        seen |= statuses(data)
    limited = limits == TIGHT and channel in ("spindle", "proximal", "distal", "current")
    assert any(status & protocol.STATUS_LIMIT_TRIPPED for status in seen) == limited
    converted = channel in ("proximal", "distal", "current", "fsr")
    assert any(status & protocol.STATUS_SATURATED for status in seen) == converted


@settings(max_examples=40)
@given(
    st.integers(0, 2**32 - 1),
    st.sampled_from([10, 3000, 2**31 - 1]),
    st.lists(st.floats(-50, 50), min_size=3, max_size=3),
    st.floats(0, 1),
    st.floats(0, 10000),
)
def test_the_controllers_round_alike(
    library: Path, seed: int, size: int, pid: list[float], weight: float, limit: float
) -> None:
    random = np.random.default_rng(seed)
    inputs = np.zeros((300, 7), np.int32)
    inputs[:, :2] = random.integers(-size - 1, size, (300, 2), endpoint=True)
    wanted = random.integers(-size - 1, size, 100, endpoint=True).tolist()
    gains = np.array([*(gain * 100 / size for gain in pid), weight, limit])
    script = [command(Kind.START, 1), arm(2, gains=gains), setpoints(3, wanted), 240]
    assert_twins(script, library, make_bench=lambda: ScriptedBench(inputs))


HELD = {"safe_state": SafeState.HOLD, "hold_command_e4": 300}
GUARDS = {
    Trip.OVER_CURRENT: ({"max_current": 1500}, "current", [1501]),
    Trip.PROXIMAL_TORQUE: ({"max_proximal": 900}, "proximal", [-901]),
    Trip.DISTAL_TORQUE: ({"max_distal": 900}, "distal", [901]),
    Trip.JAW_TRAVEL: ({"min_jaw": -50, "max_jaw": 50}, "jaw", [51]),
    Trip.OVER_SPEED: ({"max_motor_step": 100}, "motor", [0, 101, 202, 303, 404]),
    Trip.OVERHEATED: ({"continuous_current": 100, "i2t": 2}, "current", [140, 141] * 40),
    Trip.STALLED: (
        {"stall_current": 200, "stall_motion": 3, "stall_ticks": 20},
        "current",
        [210, 215] * 30,
    ),
    Trip.SENSOR_SATURATED: ({"saturated_ticks": 5}, "proximal", [32767] * 9),
    Trip.SENSOR_STALE: ({"stale_ticks": 30}, "distal", [7] * 90),
    Trip.SENSOR_MISSING: ({}, "spindle", [protocol.MISSING]),
}
"""For each trip the limits that make it, and a channel's counts that cross them."""


def moving_inputs(ticks: int) -> np.ndarray:
    """Counts of a rig at work: the motor moves, the sensors make noise."""
    tick = np.arange(ticks)
    inputs = np.zeros((ticks, 7), np.int32)
    inputs[:, 0] = 5 * tick
    inputs[:, 1] = -tick // 4
    for column in (3, 4, 5):
        inputs[:, column] = tick * (7 + column) % 23 - 11
    return inputs


def guarded_script(limits: Limits) -> list[Action]:
    script: list[Action] = [command(Kind.START, 1), arm(2, limits), setpoints(3, [0] * 100), 7]
    return [*script, 90, ping(4, 0), command(Kind.TRIP, 5), 30, command(Kind.DISARM, 6), 3]


@pytest.mark.parametrize("state", [{}, HELD], ids=["release", "hold"])
@pytest.mark.parametrize("trip", list(GUARDS), ids=lambda trip: trip.name)
def test_every_guard_trips_alike_with_its_own_code(library: Path, trip: Trip, state: dict) -> None:
    limits, channel, counts = GUARDS[trip]
    inputs = moving_inputs(140)
    column = list(EDGES).index(channel)
    inputs[10 : 10 + len(counts), column] = counts
    if trip is Trip.STALLED:
        inputs[:, 0] = 1000
    limits = dataclasses.replace(WIDEST, **limits, **state)
    script = guarded_script(limits)
    data = assert_twins(script, library, make_bench=lambda: ScriptedBench(inputs))
    assert_tripped(data, trip)
    quiet = moving_inputs(140)
    data = assert_twins(script, library, make_bench=lambda: ScriptedBench(quiet))
    assert not any(status >> protocol.TRIP_SHIFT for status in statuses(data))


@pytest.mark.parametrize("watchdog_us", [5_000, 50_000, 1_000_000])
def test_the_watchdogs_patience_is_the_hosts_choice(library: Path, watchdog_us: int) -> None:
    limits = dataclasses.replace(WIDEST, watchdog_us=watchdog_us, **HELD)
    script: list[Action] = [command(Kind.START, 1), arm(2, limits), setpoints(3, sweep(0))]
    script += [watchdog_us // 1000 + 1, 1, 20, command(Kind.TRIP, 4), command(Kind.DISARM, 5), 2]
    assert_tripped(assert_twins(script, library), Trip.HOST_SILENT)


@settings(max_examples=60)
@given(
    st.integers(0, 2**32 - 1),
    st.fixed_dictionaries(
        {
            "max_motor_step": st.integers(1, 12),
            "continuous_current": st.integers(0, 12),
            "i2t": st.integers(0, 20),
            "stall_current": st.integers(0, 15),
            "stall_motion": st.integers(0, 20),
            "stall_ticks": st.integers(1, 40),
            "saturated_ticks": st.integers(1, 3),
            "stale_ticks": st.integers(1, 6),
            "watchdog_us": st.sampled_from([5_000, 40_000, 250_000]),
            "safe_state": st.sampled_from(list(SafeState)),
            "hold_command_e4": st.integers(0, 10000),
            "max_jaw": st.integers(0, 30),
        }
    ),
)
def test_any_guard_on_any_inputs(library: Path, seed: int, limits: dict) -> None:
    random = np.random.default_rng(seed)
    inputs = moving_inputs(200)
    inputs[:, 0] = np.cumsum(random.integers(-9, 10, 200))
    inputs[:, 2] = np.cumsum(random.integers(-1, 2, 200))
    inputs[:, 3:6] = random.choice([-11, 0, 3, 11], (200, 3))
    for _ in range(3):
        value = random.choice([protocol.MISSING, 32767, -32768, 2**31 - 1])
        inputs[random.integers(0, 200), random.integers(0, 7)] = value
    script = guarded_script(dataclasses.replace(WIDEST, **limits))
    assert_twins(script, library, make_bench=lambda: ScriptedBench(inputs))


def test_holding_keeps_the_spindle_where_it_was_and_a_second_trip_releases(library: Path) -> None:
    limits = dataclasses.replace(WIDEST, watchdog_us=20_000, max_proximal=20000, **HELD)
    inputs = moving_inputs(140)
    inputs[100, 3] = 20001
    script: list[Action] = [command(Kind.START, 1), arm(2, limits), setpoints(3, [0] * 100), 130]
    data = assert_twins(script, library, make_bench=lambda: ScriptedBench(inputs))
    samples = FrameStream(42).feed(data).payloads.view(SAMPLE_DTYPE)[:, 0]
    holding = (samples["status"] & protocol.STATUS_HOLDING) != 0
    assert (np.flatnonzero(holding) == np.arange(21, 100)).all()
    assert len(set(samples["target"][holding].tolist())) == 1
    assert np.abs(samples["command_e4"][holding]).max() <= HELD["hold_command_e4"]
    assert (samples["load_ma"][holding] == 0).all()
    assert (samples["command_e4"][100:] == 0).all()
    assert {s >> protocol.TRIP_SHIFT for s in samples["status"][21:].tolist()} == {1}


def test_refusals(library: Path) -> None:
    nan = GAINS.copy()
    nan[0] = np.nan
    for gains in (nan, GAINS * np.inf, GAINS * 1e5, GAINS * [1, 1, 1, -1, 1], -GAINS):
        assert_twins([arm(1, gains=gains)], library)
    for limits in (Limits(-1, 0, 0, 0, 0, 0), Limits(0, 0, 0, 0, 1, 0)):
        assert_twins([arm(1, limits)], library)
    for change in (
        {"stall_ticks": 0},
        {"watchdog_us": 4_999},
        {"watchdog_us": 1_000_001},
        {"safe_state": 2},
        {"hold_command_e4": 10_001},
        {"min_jaw": 1, "max_jaw": 0},
        {"i2t": -1},
    ):
        data = assert_twins([arm(1, dataclasses.replace(WIDEST, **change))], library)
        assert FrameStream(42).feed(data).others[0][5] == protocol.Result.BAD_VALUE
    full: list[Action] = [setpoints(10 + k, [k] * 100) for k in range(21)]
    assert_twins([arm(1), *full, 7, setpoints(40, [0] * 8), setpoints(41, [0] * 7)], library)
    assert_twins([setpoints(1, [0]), arm(2, TIGHT), setpoints(3, [4001])], library)
    assert_twins([arm(2, TIGHT), setpoints(3, [0], 901), setpoints(4, [0], -900)], library)
    header = protocol.encode_command(Kind.HELLO, 7)
    for payload in (b"\x02" + header[1:], b"\x01\x63\x00\x00", header + b"x", header[:3], b""):
        assert_twins([encode_frame(payload)], library)
    for kind in range(30):
        assert_twins([encode_frame(bytes([1, kind, 0, 0, 0]))], library)


def test_a_repeated_command_is_answered_again_and_not_carried_out_again(library: Path) -> None:
    script: list[Action] = [command(Kind.START, 1), arm(2), setpoints(3, sweep(0)), 10]
    script += [setpoints(3, sweep(0)), 10, command(Kind.START, 1), 5, command(Kind.HELLO, 3)]
    script += [setpoints(3, sweep(0)), 120, command(Kind.DISARM, 9), command(Kind.DISARM, 9)]
    script += [command(Kind.START, 10), 5, command(Kind.DISARM, 11), command(Kind.START, 10), 5]
    assert_twins(script, library)


sequences = st.integers(0, 5)
targets = st.lists(st.integers(-6000, 6000), min_size=0, max_size=101)
commands = st.one_of(
    st.builds(command, st.sampled_from(list(Kind)), sequences),
    st.builds(arm, sequences, st.sampled_from([WIDEST, TIGHT])),
    st.builds(setpoints, sequences, targets, st.integers(-1000, 1000)),
    st.builds(lambda s, n: setpoints(s, sweep(n)), sequences, st.integers(0, 500)),
    st.builds(ping, sequences, st.integers(0, 2**64 - 1)),
    st.binary(max_size=60).map(encode_frame),
    st.binary(max_size=60),
    st.just(b"\x07" * 1100 + b"\x00"),
)
scripts = st.lists(
    st.one_of(commands, commands, st.integers(1, 300), st.integers(1, 40)), max_size=25
)


@settings(max_examples=60)
@given(scripts, st.integers(0, 2**32 - 1))
def test_any_script(library: Path, script: list[Action], start_tick_us: int) -> None:
    preamble: list[Action] = [command(Kind.START, 60000), arm(60001, TIGHT)]
    assert_twins(preamble + script, library, start_tick_us)


@settings(max_examples=30)
@given(scripts, st.integers(1, 50))
def test_the_fake_does_not_depend_on_how_time_is_cut(script: list[Action], cut: int) -> None:
    script = [command(Kind.START, 60000), arm(60001, TIGHT), *script]
    whole = answers(PythonBoard(PlainBench()), script)
    pieces: list[Action] = []
    for action in script:
        if isinstance(action, int):
            pieces += [cut] * (action // cut) + [action % cut]
        else:
            pieces.append(action)
    assert b"".join(answers(PythonBoard(PlainBench()), pieces)) == b"".join(whole)


def test_a_missing_library_says_what_to_type(tmp_path: Path) -> None:
    with pytest.raises(FirmwareMissingError, match="make -C firmware"):
        FirmwareBoard(PlainBench(), library=tmp_path / "none.so")
