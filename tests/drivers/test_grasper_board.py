"""The grasper's profile on the compiled core: three motors, each with its own guard."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from drivers.errors import ProtocolMismatchError
from drivers.teensy import protocol
from drivers.teensy.core import FirmwareBoard
from drivers.teensy.driver import TeensyLogger
from drivers.teensy.grasper import GRASPER, AxisLimits, GrasperLimits
from drivers.teensy.protocol import Kind, Result, SafeState, Trip
from drivers.transport.simulated import SimulatedTransport
from tests.drivers.raw_host import RawHost, ScriptedBench

pytestmark = pytest.mark.integration

GAINS = np.array([[2.0, 0.01, -20.0, 0.3, 5000.0], [3.0, 0, -9, 1, 4000], [1, 0, 0, 0.5, 900]])
HELD = {"safe_state": SafeState.HOLD, "hold_command_e4": 300}


def scripted(inputs: NDArray[np.int32]) -> ScriptedBench:
    return ScriptedBench(inputs, 3, GRASPER.tick_us)


def moving(ticks: int) -> NDArray[np.int32]:
    """Inputs in which every motor turns and every sensor lives."""
    tick = np.arange(ticks)
    inputs = np.zeros((ticks, len(GRASPER.input_names)), np.int32)
    for k in range(3):
        inputs[:, k] = (5 - 2 * k) * tick
        inputs[:, 3 + k] = tick * (7 + k) % 23 - 11
        inputs[:, 6 + k] = 100 + tick * (5 + k) % 19
    return inputs


def host_on(library: Path, inputs: NDArray[np.int32], gains: NDArray[Any] = GAINS) -> RawHost:
    board = FirmwareBoard(scripted(inputs), library=library, profile=GRASPER)
    host = RawHost(board, GRASPER, gains)
    assert host.command(Kind.START) is Result.OK
    return host


STILL = [[0] * 50] * 3


def test_a_whole_session_at_2_khz_with_three_motors_each_on_its_own_way(library):
    ways = [[round(40 * k * np.sin(t / 9)) for t in range(50)] for k in (1, 2, 3)]
    host = host_on(library, moving(90))
    host.run(9)
    assert host.arm() is Result.OK
    host.run(5)
    assert host.setpoints(*ways) is Result.OK
    host.run(50)
    host.command(Kind.DISARM)
    host.run(4)
    samples = host.samples()
    assert set(np.diff(samples["tick_us"]).tolist()) == {500}
    asked = samples["status"] == protocol.STATUS_REFERENCED | protocol.STATUS_ARMED
    assert np.count_nonzero(asked) == 50
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
def test_every_motor_has_every_guard(library, trip, motor, state):
    axis, first, counts = GUARDS[trip]
    axes = [AxisLimits()] * 3
    axes[motor] = AxisLimits(**axis)
    limits = GrasperLimits(tuple(axes), stall_ticks=20, saturated_ticks=4, stale_ticks=8, **state)
    inputs = moving(110)
    inputs[10 : 10 + len(counts), first + motor] = counts
    if trip is Trip.STALLED:
        inputs[:, motor] = 200
    host = host_on(library, inputs)
    host.arm(limits)
    host.setpoints(*STILL)
    host.run(100)
    report = host.trip()
    assert report.code is trip
    assert report.channel.endswith(f"_{motor + 1}")
    quiet = host_on(library, moving(110))
    quiet.arm(limits)
    quiet.run(100)
    assert trip is Trip.STALLED or quiet.trip().code is Trip.NONE


def test_refusals(library):
    for motor in range(3):
        for bad in (np.nan, np.inf, 1e7):
            gains = GAINS.copy()
            gains[motor, 2] = bad
            assert host_on(library, moving(9), gains).arm() is Result.BAD_VALUE
        axes = [AxisLimits()] * 3
        for wrong in ({"max_force": -1}, {"min_motor": 1, "max_motor": 0}, {"i2t": -1}):
            axes[motor] = AxisLimits(**wrong)
            assert host_on(library, moving(9)).arm(GrasperLimits(tuple(axes))) is Result.BAD_VALUE
    tight = GrasperLimits((AxisLimits(), AxisLimits(min_motor=-5, max_motor=5), AxisLimits()))
    host = host_on(library, moving(9))
    assert host.arm(tight) is Result.OK
    assert host.setpoints([0], [6], [0]) is Result.BAD_VALUE
    assert host.setpoints(*STILL) is Result.OK


def test_a_board_of_the_other_profile_is_named_before_anything_moves(library):
    board = FirmwareBoard(scripted(moving(9)), library=library, profile=GRASPER)
    logger = TeensyLogger(SimulatedTransport(board))
    with pytest.raises(ProtocolMismatchError, match=r'grasper.*profile = "grasper"'):
        logger.identify()
