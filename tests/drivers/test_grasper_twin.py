"""The grasper's profile: the C++ core and the Python fake answer with the same bytes."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from drivers.errors import ProtocolMismatchError
from drivers.framing import FrameStream, encode_frame
from drivers.teensy import protocol
from drivers.teensy.driver import TeensyLogger
from drivers.teensy.fake import PythonBoard
from drivers.teensy.firmware_fake import FirmwareBoard
from drivers.teensy.grasper import GRASPER, AxisLimits, GrasperLimits
from drivers.teensy.grasper_guard import COLUMNS, GRASPER_LOGIC, INPUTS, GrasperDrive, run_ticks
from drivers.teensy.protocol import Kind, Result, SafeState, Trip
from drivers.teensy.reference import REFERENCE
from drivers.transport.simulated import SimulatedTransport
from tests.drivers.bench_physics import TICK_FUNCTION

pytestmark = pytest.mark.integration

GAINS = np.array([[2.0, 0.01, -20.0, 0.3, 5000.0], [3.0, 0, -9, 1, 4000], [1, 0, 0, 0.5, 900]])
WIDEST = GrasperLimits()
HELD = {"safe_state": SafeState.HOLD, "hold_command_e4": 300}

Action = bytes | int


class ScriptedGrasper:
    """No physics: the inputs of each tick, shape (n, 9), are given; then the last ones stay."""

    def __init__(self, inputs: NDArray[np.int32]) -> None:
        self._inputs = np.ascontiguousarray(inputs, np.int32)
        self._ticks = 0

    def _next(self) -> NDArray[np.int32]:
        row = self._inputs[min(self._ticks, len(self._inputs) - 1)]
        self._ticks += 1
        return row

    def advance(
        self,
        ticks: int,
        one: NDArray[np.int32],
        two: NDArray[np.int32],
        three: NDArray[np.int32],
        drive: GrasperDrive,
    ) -> NDArray[np.int32]:
        rows = np.zeros((ticks, COLUMNS), np.int32)
        for row in rows:
            row[:INPUTS] = self._next()
        run_ticks(rows, np.column_stack((one, two, three)), *drive.arrays)
        return rows

    def advance_with_board(
        self, ticks: int, tick_address: int, board_address: int, tick_us: int
    ) -> None:
        tick = TICK_FUNCTION(tick_address)
        outputs = np.zeros(3, np.int32)
        for k in range(ticks):
            clock_us = (tick_us + GRASPER.tick_us * k) % 2**32
            tick(board_address, clock_us, self._next().ctypes.data, outputs.ctypes.data)


def moving(ticks: int) -> NDArray[np.int32]:
    """Inputs in which every motor turns and every sensor lives."""
    tick = np.arange(ticks)
    inputs = np.zeros((ticks, INPUTS), np.int32)
    for k in range(3):
        inputs[:, k] = (5 - 2 * k) * tick
        inputs[:, 3 + k] = tick * (7 + k) % 23 - 11
        inputs[:, 6 + k] = 100 + tick * (5 + k) % 19
    return inputs


def command(kind: Kind, sequence: int) -> bytes:
    return encode_frame(protocol.encode_command(kind, sequence))


def arm(sequence: int, limits: GrasperLimits = WIDEST, gains: NDArray = GAINS) -> bytes:
    return encode_frame(GRASPER.encode_arm(sequence, gains, limits))


def setpoints(sequence: int, *targets: list[int]) -> bytes:
    return encode_frame(GRASPER.encode_setpoints(sequence, [np.array(t) for t in targets]))


def still(sequence: int, count: int = 50) -> bytes:
    return setpoints(sequence, *[[0] * count] * 3)


def assert_twins(
    script: list[Action], library: Path, inputs: NDArray[np.int32], start_tick_us: int = 0
) -> NDArray[np.void]:
    """Run a script on both and return the samples they agree on."""
    core = FirmwareBoard(
        ScriptedGrasper(inputs), start_tick_us=start_tick_us, library=library, profile=GRASPER
    )
    fake = PythonBoard(
        ScriptedGrasper(inputs),
        start_tick_us=start_tick_us,
        build_hash=core.build_hash,
        logic=GRASPER_LOGIC,
    )
    data = b""
    for index, action in enumerate(script):
        for board in (core, fake):
            board.receive(action) if isinstance(action, bytes) else board.advance(action)
        ours, theirs = fake.transmit(), core.transmit()
        assert ours == theirs, f"action {index}: {action!r}"
        data += ours
    frames = FrameStream(GRASPER.sample.itemsize).feed(data)
    assert frames.bad == 0
    return frames.payloads.view(GRASPER.sample).reshape(-1)


def test_its_contract_and_its_sample_differ_from_every_other_frame() -> None:
    assert GRASPER.protocol_hash != REFERENCE.protocol_hash
    sizes = {layout.itemsize for kind, layout in GRASPER.layouts.items() if kind is not Kind.SAMPLE}
    assert GRASPER.sample.itemsize == 56
    assert GRASPER.sample.itemsize not in sizes
    assert (GRASPER.sample.itemsize - 4) % GRASPER.setpoint.itemsize
    assert GRASPER.rate_hz == 2000


def test_a_whole_session_at_2_khz_with_three_motors_each_on_its_own_way(library: Path) -> None:
    ways = [[round(40 * k * np.sin(t / 9)) for t in range(50)] for k in (1, 2, 3)]
    script: list[Action] = [command(Kind.HELLO, 1), command(Kind.START, 2), 9, arm(3), 5]
    script += [setpoints(4, *ways), 60, command(Kind.DISARM, 5), 4, command(Kind.STOP, 6), 3]
    samples = assert_twins(script, library, moving(90), start_tick_us=2**32 - 10_000)
    assert set(np.diff(samples["tick_us"]).tolist()) == {500}
    asked = samples["status"] == protocol.STATUS_ARMED
    for k, way in enumerate(ways, 1):
        assert samples[f"target_{k}"][asked][-50:].tolist() == way
        assert np.abs(samples[f"command_{k}_e4"]).max() > 0
        assert (samples[f"command_{k}_e4"][-4:] == 0).all()


GUARDS = {
    Trip.OVER_CURRENT: ({"max_current": 500}, 3, [-501]),
    Trip.OVER_FORCE: ({"max_force": 900}, 6, [901]),
    Trip.MOTOR_TRAVEL: ({"min_motor": -300, "max_motor": 700}, 0, [701]),
    Trip.OVER_SPEED: ({"max_motor_step": 30}, 0, [0, 40, 80, 120, 160]),
    Trip.OVERHEATED: ({"continuous_current": 100, "i2t": 2}, 3, [140, 141] * 40),
    Trip.STALLED: ({"stall_current": 30, "stall_motion": 3}, 3, [60, 61] * 40),
    Trip.SENSOR_SATURATED: ({}, 6, [4095] * 9),
    Trip.SENSOR_STALE: ({}, 3, [77] * 9),
    Trip.SENSOR_MISSING: ({}, 0, [protocol.MISSING]),
}


@pytest.mark.parametrize("state", [{}, HELD], ids=["release", "hold"])
@pytest.mark.parametrize("motor", [0, 1, 2])
@pytest.mark.parametrize("trip", list(GUARDS), ids=lambda trip: trip.name)
def test_every_motor_has_every_guard(library: Path, trip: Trip, motor: int, state: dict) -> None:
    axis, first, counts = GUARDS[trip]
    axes = [AxisLimits()] * 3
    axes[motor] = AxisLimits(**axis)
    limits = GrasperLimits(tuple(axes), stall_ticks=20, saturated_ticks=4, stale_ticks=8, **state)
    inputs = moving(110)
    inputs[10 : 10 + len(counts), first + motor] = counts
    if trip is Trip.STALLED:
        inputs[:, motor] = 200
    script: list[Action] = [command(Kind.START, 1), arm(2, limits), still(3), 100]
    script += [command(Kind.TRIP, 4), command(Kind.DISARM, 5), 3]
    samples = assert_twins(script, library, inputs)
    assert set((samples["status"] >> protocol.TRIP_SHIFT).tolist()) == {0, trip}
    board = FirmwareBoard(ScriptedGrasper(inputs), library=library, profile=GRASPER)
    for action in script[:4]:
        board.receive(action) if isinstance(action, bytes) else board.advance(action)
    board.transmit()
    with TeensyLogger(SimulatedTransport(board, tick_s=GRASPER.tick_us * 1e-6), GRASPER) as logger:
        report = logger.trip()
    assert report.code is trip
    assert report.channel.endswith(f"_{motor + 1}")
    quiet = assert_twins(script, library, moving(110))
    assert trip is Trip.STALLED or not (quiet["status"] >> protocol.TRIP_SHIFT).any()


@settings(max_examples=40)
@given(
    st.integers(0, 2**32 - 1),
    st.fixed_dictionaries(
        {
            "max_motor_step": st.integers(1, 12),
            "continuous_current": st.integers(0, 12),
            "i2t": st.integers(0, 20),
            "stall_current": st.integers(0, 15),
            "stall_motion": st.integers(0, 20),
        }
    ),
    st.fixed_dictionaries(
        {
            "stall_ticks": st.integers(1, 40),
            "saturated_ticks": st.integers(1, 3),
            "stale_ticks": st.integers(1, 6),
            "watchdog_us": st.sampled_from([5_000, 40_000, 250_000]),
            "safe_state": st.sampled_from(list(SafeState)),
            "hold_command_e4": st.integers(0, 10000),
        }
    ),
    st.integers(0, 2**32 - 1),
)
def test_any_guard_on_any_inputs(
    library: Path, seed: int, axis: dict, choice: dict, start_tick_us: int
) -> None:
    random = np.random.default_rng(seed)
    inputs = moving(160)
    inputs[:, :3] = np.cumsum(random.integers(-9, 10, (160, 3)), axis=0)
    inputs[:, 3:6] = random.choice([-11, 0, 3, 11], (160, 3))
    for _ in range(3):
        value = random.choice([protocol.MISSING, 32767, -32768, 2**31 - 1, 4095])
        inputs[random.integers(0, 160), random.integers(0, 9)] = value
    axes = [AxisLimits()] * 3
    axes[random.integers(0, 3)] = AxisLimits(**axis)
    limits = GrasperLimits(tuple(axes), **choice)
    script: list[Action] = [command(Kind.START, 1), arm(2, limits), still(3), 7, 90]
    script += [command(Kind.TRIP, 5), 30, still(6), command(Kind.DISARM, 7), 3]
    assert_twins(script, library, inputs, start_tick_us)


def test_refusals(library: Path) -> None:
    refused = []
    for motor in range(3):
        for bad in (np.nan, np.inf, 1e7):
            gains = GAINS.copy()
            gains[motor, 2] = bad
            refused.append(arm(1, gains=gains))
        axes = [AxisLimits()] * 3
        for wrong in ({"max_force": -1}, {"min_motor": 1, "max_motor": 0}, {"i2t": -1}):
            axes[motor] = AxisLimits(**wrong)
            refused.append(arm(1, GrasperLimits(tuple(axes))))
    refused.append(arm(1, dataclasses.replace(WIDEST, watchdog_us=4_999)))
    tight = GrasperLimits((AxisLimits(), AxisLimits(min_motor=-5, max_motor=5), AxisLimits()))
    for frame in refused:
        board = PythonBoard(ScriptedGrasper(moving(9)), logic=GRASPER_LOGIC)
        board.receive(frame)
        answer = FrameStream(0).feed(board.transmit()).others[0]
        assert answer[5] == Result.BAD_VALUE
        assert_twins([frame, 3], library, moving(9))
    script: list[Action] = [still(1), arm(2, tight), setpoints(3, [0], [6], [0]), still(4)]
    script += [still(10 + k) for k in range(40)]
    assert_twins([*script, 30, still(99)], library, moving(40))


def test_a_board_of_the_other_profile_is_named_before_anything_moves(library: Path) -> None:
    board = FirmwareBoard(ScriptedGrasper(moving(9)), library=library, profile=GRASPER)
    logger = TeensyLogger(SimulatedTransport(board))
    with pytest.raises(ProtocolMismatchError, match=r'grasper.*profile = "grasper"'):
        logger.identify()
