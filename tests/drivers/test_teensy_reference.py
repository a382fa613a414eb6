"""A board's counts mean nothing until its zeros are set: the firmware core."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from drivers.errors import CommandRefusedError
from drivers.teensy.core import BoardStart, FirmwareBoard
from drivers.teensy.driver import TeensyLogger
from drivers.teensy.protocol import STATUS_REFERENCED, Result
from drivers.teensy.reference import Limits
from drivers.transport.simulated import SimulatedTransport
from tests.drivers.raw_host import ScriptedBench

GAINS = [1.0, 0.0, 0.0, 1.0, 100.0]
STANDS = np.array([[700, -40, 9, 1, -1, 2, 0], [700, -40, 9, 2, 1, -2, 0]] * 500, np.int32)


def logger_of(library: Path, inputs: np.ndarray = STANDS, boot: int = 7) -> TeensyLogger:
    bench = ScriptedBench(inputs)
    board = FirmwareBoard(bench, BoardStart(boot=boot, simulated=False), library)
    return TeensyLogger(SimulatedTransport(board, "sim://"))


def newest(logger: TeensyLogger) -> np.void:
    sample: np.void = logger.read(1.0).samples[-1]
    return sample


def at_rest(logger: TeensyLogger) -> None:
    """Let the board see that nothing turns."""
    while newest(logger)["sequence"] < 150:
        logger.heartbeat()


def test_a_board_that_was_started_is_not_armed_before_it_is_referenced(library):
    with logger_of(library) as logger:
        identity = logger.identify()
        assert (identity.boot, identity.referenced) == (7, False)
        logger.start()
        assert not newest(logger)["status"] & STATUS_REFERENCED
        with pytest.raises(CommandRefusedError, match="rig reference") as refused:
            logger.arm(GAINS, Limits())
        assert refused.value.code == Result.NOT_REFERENCED
        at_rest(logger)
        logger.reference([0, 1000, 500])
        sample = newest(logger)
        assert [int(sample[name]) for name in ("motor", "spindle", "jaw")] == [0, 1000, 500]
        assert sample["status"] & STATUS_REFERENCED
        logger.arm(GAINS, Limits())
        logger.disarm()
        assert logger.identify().referenced


def test_the_index_gives_the_reference_once_wherever_the_shaft_stands_then(library):
    inputs = STANDS.copy()
    inputs[:300, :3] += np.outer(np.clip(np.arange(300) - 280, -20, 0), [35, 2, 1])
    board = FirmwareBoard(ScriptedBench(inputs), BoardStart(simulated=False), library)
    with TeensyLogger(SimulatedTransport(board, "sim://")) as logger:
        logger.identify()
        board.advance(270)  # ten ticks before it stands
        board.index()
        logger.start()
        at_rest(logger)
        logger.reference([0, 1000, 500], at_index=True)
        sample = newest(logger)
        assert [int(sample[name]) for name in ("motor", "spindle", "jaw")] == [350, 1020, 510]
        assert sample["status"] & STATUS_REFERENCED
        with pytest.raises(CommandRefusedError, match="through its index") as refused:
            logger.reference([0, 1000, 500], at_index=True)
        assert refused.value.code == Result.NO_INDEX


def test_a_shaft_that_turns_is_not_referenced(library):
    turning = STANDS.copy()
    turning[:, 0] += 5 * np.arange(len(turning))
    with logger_of(library, turning) as logger:
        logger.start()
        at_rest(logger)
        with pytest.raises(CommandRefusedError, match="shaft is turning"):
            logger.reference([0, 0, 0])


def test_a_failed_check_of_an_encoder_takes_its_reference(library):
    jumps = STANDS.copy()
    jumps[600:, 1] += 500
    with logger_of(library, jumps) as logger:
        logger.start()
        at_rest(logger)
        logger.reference([0, 0, 0])
        limits = replace(Limits(), max_spindle_jump=100, watchdog_us=1_000_000)
        logger.arm(GAINS, limits)
        while newest(logger)["sequence"] < 700:
            logger.heartbeat()
        assert not newest(logger)["status"] & STATUS_REFERENCED
        logger.clear(logger.trip().code)
        with pytest.raises(CommandRefusedError, match="rig reference"):
            logger.arm(GAINS, limits)
