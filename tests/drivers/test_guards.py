"""The guards of the compiled core on the reference rig: what trips, when, and what it does then."""

import dataclasses

import numpy as np
import pytest

from drivers.teensy import protocol
from drivers.teensy.core import BoardStart, CoreGuard, FirmwareBoard, FirmwareMissingError
from drivers.teensy.protocol import Kind, Result, SafeState, Trip
from drivers.teensy.reference import Limits
from rig.simulation.bench import SimulatedBench
from tests.drivers.raw_host import GAINS, RawHost, ScriptedBench

WIDEST = Limits()
TIGHT = Limits(
    max_current=1500,
    max_load_ma=900,
    max_proximal=5800,
    max_distal=30000,
    min_spindle=-4000,
    max_spindle=4000,
)


EDGES = {
    "motor": [0],
    "spindle": [-4001, -4000, 4000, 4001],
    "jaw": [-(2**31) + 1, 2**31 - 1],
    "proximal": [-32769, -32768, -32767, -5801, -5800, 5800, 5801, 32766, 32767, 32768],
    "distal": [-32769, -32768, -32767, -30001, -30000, 30000, 30001, 32767],
    "current": [-32768, -1501, -1500, 1500, 1501, 32766, 32767],
    "fsr": [-1, 4094, 4095, 4096, 65536],
}


def armed_on(library, inputs, limits=WIDEST, gains=GAINS):
    """A host that has armed a core whose inputs are given."""
    host = RawHost(FirmwareBoard(ScriptedBench(inputs), library=library), gains=gains)
    assert host.command(Kind.START) is Result.OK
    assert host.arm(limits) is Result.OK
    return host


@pytest.mark.parametrize("limits", [WIDEST, TIGHT], ids=["widest", "tight"])
@pytest.mark.parametrize("channel", list(EDGES))
def test_the_edges_of_every_channel(library, channel, limits):
    crossed = {}
    saturated = False
    for value in EDGES[channel]:
        inputs = np.zeros((4, 7), np.int32)
        inputs[2, list(EDGES).index(channel)] = value
        host = armed_on(library, inputs, limits)
        host.setpoints([0] * 9, [0] * 9)
        host.run(6)
        status = host.samples()["status"]
        crossed[value] = bool((status & protocol.STATUS_LIMIT_TRIPPED).any())
        saturated |= bool((status & protocol.STATUS_SATURATED).any())
    if limits == TIGHT and channel in ("spindle", "proximal", "distal", "current"):
        most = {"spindle": 4000, "proximal": 5800, "distal": 30000, "current": 1500}[channel]
        assert crossed == {value: abs(value) > most for value in EDGES[channel]}
    else:
        assert not any(crossed.values())
    assert saturated == (channel in ("proximal", "distal", "current", "fsr"))


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


def crossing(trip: Trip, **state: int) -> tuple[np.ndarray, Limits]:
    """Counts that make a trip from the tenth tick on, and the limits that they cross."""
    changes, channel, counts = GUARDS[trip]
    inputs = moving_inputs(140)
    inputs[10 : 10 + len(counts), list(EDGES).index(channel)] = counts
    if trip is Trip.STALLED:
        inputs[:, 0] = 1000
    return inputs, dataclasses.replace(WIDEST, **changes, **state)


@pytest.mark.parametrize("state", [{}, HELD], ids=["release", "hold"])
@pytest.mark.parametrize("trip", list(GUARDS), ids=lambda trip: trip.name)
def test_every_guard_trips_with_its_own_code(library, trip, state):
    inputs, limits = crossing(trip, **state)
    for rows, expected in ((inputs, trip), (moving_inputs(140), Trip.NONE)):
        host = armed_on(library, rows, limits)
        host.setpoints([0] * 100, [0] * 100)
        host.run(97)
        report = host.trip()
        assert report.code is expected
        if trip is not Trip.STALLED:  # its quiet rig stands still too
            assert (report.channel == GUARDS[trip][1]) == (expected is not Trip.NONE)


def test_the_guard_alone_finds_what_the_board_trips_over(library):
    for trip in GUARDS:
        inputs, limits = crossing(trip)
        host = armed_on(library, inputs, limits)
        host.run(97)
        report = host.trip()
        guard = CoreGuard(host.profile, GAINS, limits, library)
        row, *found = guard.first_crossing(inputs[:97, :6], np.ones(97))
        code, number, *numbers = found
        assert (code, numbers) == (report.code, [report.value, report.limit, report.late_us])
        assert host.profile.input_names[number] == report.channel
        assert row * 1000 == report.tick_us


def test_a_late_sample_is_judged_by_the_time_that_passed(library):
    limits = dataclasses.replace(WIDEST, max_motor_step=10, max_motor_jump=40)
    rows = np.zeros((4, 6), np.int32)
    rows[:, 0] = (0, 90, 180, 270)
    for ticks, expected in ((10.0, Trip.NONE), (1.0, Trip.ENCODER_JUMP)):
        guard = CoreGuard(RawHost(FirmwareBoard(SimulatedBench())).profile, GAINS, limits, library)
        assert guard.first_crossing(rows, np.full(4, ticks))[1] == expected


@pytest.mark.parametrize("watchdog_us", [5_000, 50_000, 1_000_000])
def test_the_watchdogs_patience_is_the_hosts_choice(library, watchdog_us):
    host = armed_on(library, moving_inputs(9), dataclasses.replace(WIDEST, watchdog_us=watchdog_us))
    host.run(watchdog_us // 1000 + 1)
    assert host.armed
    host.run(1)
    assert host.trip().code is Trip.HOST_SILENT


def test_holding_keeps_the_spindle_where_it_was_and_a_second_trip_releases(library):
    limits = dataclasses.replace(WIDEST, watchdog_us=20_000, max_proximal=20000, **HELD)
    inputs = moving_inputs(140)
    inputs[100, 3] = 20001
    host = armed_on(library, inputs, limits)
    host.setpoints([0] * 100, [0] * 100)
    host.run(130)
    samples = host.samples()
    holding = (samples["status"] & protocol.STATUS_HOLDING) != 0
    assert (np.flatnonzero(holding) == np.arange(21, 100)).all()
    assert len(set(samples["target"][holding].tolist())) == 1
    assert np.abs(samples["command_e4"][holding]).max() <= HELD["hold_command_e4"]
    assert (samples["load_ma"][holding] == 0).all()
    assert (samples["command_e4"][100:] == 0).all()
    assert {s >> protocol.TRIP_SHIFT for s in samples["status"][21:].tolist()} == {1}


def test_holding_ends_after_its_time(library):
    limits = dataclasses.replace(WIDEST, watchdog_us=20_000, hold_ticks=40, **HELD)
    host = armed_on(library, moving_inputs(140), limits)
    host.setpoints([0] * 100, [0] * 100)
    host.run(130)
    samples = host.samples()
    holding = (samples["status"] & protocol.STATUS_HOLDING) != 0
    assert np.flatnonzero(holding).tolist() == list(range(21, 61))
    assert not samples["command_e4"][61:].any()
    assert host.trip().code is Trip.HOST_SILENT


def test_a_queue_that_is_dry_for_too_long_is_a_trip_however_often_the_host_pings(library):
    host = armed_on(library, moving_inputs(900), dataclasses.replace(WIDEST, dry_ticks=100))
    for _ in range(30):
        host.run(10)
        host.ping()
    assert host.armed, "without a setpoint no motor has current, for as long as the host likes"
    host.setpoints([0] * 20, [700] * 20)
    for _ in range(30):
        host.run(10)
        host.ping()
    report = host.trip()
    assert report.code is Trip.QUEUE_RAN_DRY
    assert report.late_us == 100_000
    samples = host.samples()
    assert np.count_nonzero(samples["load_ma"]) == 20 + 100
    assert not samples["command_e4"][-170:].any()


def test_heat_outlives_arming_and_clearing(library):
    limits = dataclasses.replace(WIDEST, continuous_current=100, i2t=1000)
    inputs = np.zeros((4000, 7), np.int32)
    inputs[:, 5] = 210 + np.arange(4000) % 3
    host = armed_on(library, inputs, limits)
    squared, passed = 0.0, 0
    while passed < 4000:  # a host that clears and arms as soon as it may
        host.run(1)
        host.ping()
        passed += 1
        if not host.armed:
            trip = host.trip().code
            assert trip in (Trip.OVERHEATED, Trip.NONE)
            host.clear(trip)
            host.arm(limits)
        squared += float(np.square(inputs[passed - 1, 5], dtype=float)) if host.armed else 0.0
    assert host.trip().code is Trip.NONE or not host.armed
    # what stays warm is never armed again: the heat of one reserve, and no more
    assert squared / 1000 <= 1000 + 100**2 * 4.0


def test_a_hot_motor_is_armed_again_when_it_has_cooled(library):
    limits = dataclasses.replace(WIDEST, continuous_current=100, i2t=5000)
    inputs = np.zeros((3000, 7), np.int32)
    inputs[:80, 5] = 300
    host = armed_on(library, inputs, limits)
    host.run(2)
    assert host.trip().code is Trip.NONE
    host.ping()
    host.run(80)
    assert host.trip().code is Trip.OVERHEATED
    host.clear(Trip.OVERHEATED)
    assert host.arm(limits) is Result.TOO_HOT
    host.run(3000)
    assert host.arm(limits) is Result.OK


def test_a_board_that_was_just_started_takes_its_motors_for_hot(library):
    limits = dataclasses.replace(WIDEST, continuous_current=100, i2t=5000)  # cools in 0.5 s
    inputs = np.zeros((3000, 7), np.int32)
    board = FirmwareBoard(ScriptedBench(inputs), BoardStart(simulated=False), library)
    host = RawHost(board)
    host.run(150)
    assert host.ack(protocol.encode(Kind.REFERENCE, 7, 0, 0, 0, False))[0] is Result.OK
    assert host.arm(limits) is Result.TOO_HOT
    host.run(150)
    assert host.arm(limits) is Result.OK


def test_the_load_motors_heat_is_that_of_the_current_it_is_given(library):
    limits = dataclasses.replace(WIDEST, continuous_load_ma=500, load_i2t=75_000)
    host = armed_on(library, moving_inputs(3000), limits)
    for _ in range(30):
        host.setpoints([0] * 20, [1000] * 20)
        host.run(20)
        report = host.trip()
        if report.code is not Trip.NONE:
            break
    assert report.code is Trip.OVERHEATED
    assert report.channel == "load_ma"
    assert report.late_us / 1e6 == pytest.approx(75_000 / (1000**2 - 500**2), abs=0.005)
    host.clear(Trip.OVERHEATED)
    assert host.arm(limits) is Result.TOO_HOT


def test_an_emergency_stop_releases_at_once_and_is_cleared_when_it_is_let_go(library):
    host = armed_on(library, moving_inputs(300), dataclasses.replace(WIDEST, **HELD))
    host.setpoints([0] * 90, [0] * 90)
    host.run(20)
    host.board.stop(True)
    host.run(5)
    assert host.trip().code is Trip.EMERGENCY_STOP
    samples = host.samples()
    assert samples["command_e4"][19]
    assert not samples["command_e4"][20:].any()
    assert not (samples["status"] & protocol.STATUS_HOLDING).any()
    host.clear(Trip.EMERGENCY_STOP)
    assert host.arm() is Result.TRIPPED
    host.run(1)
    assert host.trip().code is Trip.EMERGENCY_STOP
    host.board.stop(False)
    host.run(1)
    assert host.clear(Trip.EMERGENCY_STOP) is Result.OK
    assert host.arm() is Result.OK


def test_setpoints_neither_jump_nor_begin_far_from_the_shaft(library):
    limits = dataclasses.replace(WIDEST, max_target_step=30, max_following=400)
    inputs = np.zeros((300, 7), np.int32)
    inputs[:, 1] = 1000
    host = armed_on(library, inputs, limits)
    assert host.setpoints([1401], [0]) is Result.OK
    host.run(3)
    assert host.trip().code is Trip.FOLLOWING_ERROR
    assert not host.samples()["command_e4"].any()
    host.clear(Trip.FOLLOWING_ERROR)
    assert host.arm(limits) is Result.OK
    assert host.setpoints([1390, 1421], [0, 0]) is Result.TOO_FAST
    assert host.setpoints([1390, 1370], [0, 0]) is Result.OK
    assert host.setpoints([1339], [0]) is Result.TOO_FAST
    host.run(10)
    assert host.setpoints([1339], [0]) is Result.TOO_FAST
    assert host.setpoints([1340], [0]) is Result.OK


def test_no_host_raises_a_limit_that_the_board_was_built_with(library):
    own = dataclasses.replace(TIGHT, watchdog_us=100_000, torque_e3=70, dry_ticks=500)
    board = FirmwareBoard(SimulatedBench(), library=library, own=([1, 0, 0, 0, 2700], own))
    within = {"gains": [20.0, 0, 0, 0.5, 2700.0], "limits": own}
    host = RawHost(board, gains=within["gains"])
    for change in (
        {"max_current": 1501},
        {"max_load_ma": 901},
        {"min_spindle": -4001},
        {"max_spindle": 4001},
        {"watchdog_us": 100_001},
        {"torque_e3": 0},
        {"dry_ticks": 501},
    ):
        assert host.arm(dataclasses.replace(own, **change)) is Result.BEYOND_BOARD
    assert RawHost(board).arm(own) is Result.BEYOND_BOARD  # its command is larger
    away = RawHost(board, gains=np.array([-20.0, 0, 0, 0.5, 2700.0]))
    assert away.arm(own) is Result.BEYOND_BOARD
    narrower = dataclasses.replace(own, max_current=1000, min_spindle=-100, stall_motion=9)
    assert host.arm(narrower) is Result.OK


def test_refusals(library):
    nan = GAINS.copy()
    nan[0] = np.nan
    for gains in (nan, GAINS * np.inf, GAINS * 1e5, GAINS * [1, 1, 1, -1, 1], -GAINS):
        host = RawHost(FirmwareBoard(SimulatedBench(), library=library), gains=gains)
        assert host.arm() is Result.BAD_VALUE
    host = RawHost(FirmwareBoard(SimulatedBench(), library=library))
    for change in (
        {"max_current": -1},
        {"min_spindle": 1, "max_spindle": 0},
        {"stall_ticks": 0},
        {"dry_ticks": 0},
        {"watchdog_us": 4_999},
        {"watchdog_us": 1_000_001},
        {"safe_state": 2},
        {"hold_command_e4": 10_001},
        {"min_jaw": 1, "max_jaw": 0},
        {"i2t": -1},
    ):
        assert host.arm(dataclasses.replace(WIDEST, **change)) is Result.BAD_VALUE
    assert host.setpoints([0], [0]) is Result.NOT_ARMED
    assert host.arm(TIGHT) is Result.OK
    assert host.setpoints([4001], [0]) is Result.BAD_VALUE
    assert host.setpoints([0], [901]) is Result.BAD_VALUE
    assert host.setpoints([0], [-900]) is Result.OK
    for k in range(19):
        assert host.setpoints([k] * 100, [0] * 100) is Result.OK
    assert host.setpoints([0] * 100, [0] * 100) is Result.QUEUE_FULL
    assert host.setpoints([0] * 99, [0] * 99) is Result.OK
    header = protocol.encode(Kind.HELLO, 7)
    for payload, reason in (
        (b"\x02" + header[1:], Result.WRONG_VERSION),
        (b"\x01\x63\x00\x00", Result.UNKNOWN_KIND),
        (header + b"x", Result.WRONG_SIZE),
    ):
        assert host.ack(payload)[0] is reason
    for kind in (Kind.ARM, Kind.SETPOINTS, Kind.PING, Kind.CLEAR, Kind.REFERENCE):
        for size in (4, 6, 8, 9):
            expected = Result.OK if (kind, size) == (Kind.CLEAR, 5) else Result.WRONG_SIZE
            assert host.ack(bytes([1, kind, 0, 0]) + bytes(size - 4))[0] is expected
    assert host.send(header[:3]) == host.send(b"") == []


def test_a_host_that_does_not_read_loses_whole_frames_and_gets_their_number(library):
    board = FirmwareBoard(SimulatedBench(), library=library)
    host = RawHost(board)
    host.command(Kind.START)
    board.advance(3000)
    board.advance(1500)
    host.run(1)
    host.run(1)
    last = host.samples()[-1]
    assert last["dropped"] > 1000
    assert last["sequence"] == 4501


def test_a_missing_library_reports_what_to_type(tmp_path):
    with pytest.raises(FirmwareMissingError, match="make -C firmware"):
        FirmwareBoard(SimulatedBench(), library=tmp_path / "none.so")
    (tmp_path / "other.so").write_bytes(b"no library")
    with pytest.raises(FirmwareMissingError, match="make -C firmware"):
        FirmwareBoard(SimulatedBench(), library=tmp_path / "other.so")
