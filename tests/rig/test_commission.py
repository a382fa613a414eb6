"""The first motion of a wired bench: every wrong wire is a sentence, and nothing goes far."""

import ctypes

import numpy as np
import pytest

from drivers.teensy.core import BoardStart, FirmwareBoard
from drivers.transport.simulated import SimulatedTransport
from rig.cli.main import main
from rig.doctor.commission import REACH_RAD, commission
from rig.simulation.bench import SimulatedBench
from tests.rig.simulated import simulated

pytestmark = [pytest.mark.integration, pytest.mark.usefixtures("library")]

MOTOR, SPINDLE, JAW, CURRENT = 0, 1, 2, 5
TICK = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_uint32, ctypes.c_void_p, ctypes.c_void_p)


class MiswiredBench:
    """The simulated bench with inputs and the command wired wrong.

    Args:
        factors: Factor of each input that is wired wrong: -1 for A and B swapped, 0 for a cable.
        command: Factor of the command.
    """

    def __init__(self, factors: dict[int, int], command: int = 1) -> None:
        self._inner = SimulatedBench()
        self._factors = factors
        self._command = command
        self.spindle: list[int] = []

    def advance_with_board(self, ticks, tick_address, board_address, tick_us):
        core = TICK(tick_address)

        def between(board: int, now_us: int, inputs: int, outputs: int) -> None:
            row = np.ctypeslib.as_array((ctypes.c_int32 * 7).from_address(inputs))
            self.spindle.append(int(row[SPINDLE]))
            for column, factor in self._factors.items():
                row[column] *= factor
            core(board, now_us, inputs, outputs)
            given = np.ctypeslib.as_array((ctypes.c_int32 * 2).from_address(outputs))
            given[0] *= self._command

        called = TICK(between)
        address = ctypes.cast(called, ctypes.c_void_p).value or 0
        self._inner.advance_with_board(ticks, address, board_address, tick_us)


def results(bench, monkeypatch, config=None):
    link = SimulatedTransport(FirmwareBoard(bench), step_s=0.02)
    monkeypatch.setattr("rig.bench.logger.open_logger", lambda _: link)
    return {check.name: check.passed for check in commission(config or simulated())}


def test_a_sound_rig_passes_both_ways():
    assert main(["commission", "--sim"]) == 0


@pytest.mark.parametrize(
    ("factors", "command", "failed"),
    [
        ({MOTOR: -1}, 1, "motor_angle_rad follows, closing"),
        ({SPINDLE: -1}, 1, "spindle_angle_rad follows, closing"),
        ({JAW: -1}, 1, "jaw_angle_rad follows, closing"),
        ({SPINDLE: 0}, 1, "spindle_angle_rad follows, closing"),
        ({MOTOR: 0}, 1, "motor_angle_rad follows, closing"),
        ({CURRENT: 0}, 1, "the measured current follows the command, closing"),
        ({}, -1, "the measured current follows the command, closing"),
        ({}, 0, "the measured current follows the command, closing"),
    ],
)
def test_a_wrong_wire_is_named_and_the_shaft_hardly_turns(monkeypatch, factors, command, failed):
    bench = MiswiredBench(factors, command)
    made = results(bench, monkeypatch)
    assert [name for name, passed in made.items() if not passed] == [failed]
    turned_rad = np.ptp(bench.spindle) * 2 * np.pi / 8192
    assert turned_rad < 2 * REACH_RAD


def test_a_board_without_zeros_does_not_move(monkeypatch):
    bench = MiswiredBench({})
    link = SimulatedTransport(FirmwareBoard(bench, BoardStart(simulated=False)), step_s=0.02)
    monkeypatch.setattr("rig.bench.logger.open_logger", lambda _: link)
    *_, last = commission(simulated())
    assert not last.passed
    assert "rig reference" in last.detail
    assert np.ptp(bench.spindle or [0]) < 5
