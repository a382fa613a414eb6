"""The acceptance test of a bench, and its first motion: every wrong wire is a sentence.

On fakes here, the acceptance test on a real bench where RIG_BENCH names it.
"""

import ctypes
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from drivers.teensy.core import TICK, BoardStart, FirmwareBoard
from drivers.teensy.profile import Profile
from drivers.transport.simulated import SimulatedTransport
from rig.configuration.check import refuse_problems
from rig.configuration.config import load_config
from rig.doctor.commission import REACH_RAD, commission
from rig.doctor.selftest import bench_tests, selftest
from rig.simulation.bench import SimulatedBench
from tests.rig.simulated import behind, simulated, transport

pytestmark = pytest.mark.integration


def all_pass(checks):
    """Require that all checks pass; return how many there are."""
    done = list(checks)
    assert done
    assert all(check.passed for check in done), [c for c in done if not c.passed]
    return len(done)


@pytest.mark.bench
def test_the_bench_passes_its_acceptance_test():
    named = os.environ.get("RIG_BENCH")
    if named is None:
        pytest.skip("no bench: set RIG_BENCH to a configuration, as for `rig selftest -c`")
    config = load_config(Path(named))
    refuse_problems(config)
    all_pass(selftest(config))


@pytest.mark.parametrize("names", [("usb520", "ati-can", "amt21"), ("qia128", "ati-net", "epos4")])
def test_the_simulated_rig_passes_with_every_kind_of_device(names, library):
    devices = {name.replace("-", "_"): {"driver": name, "url": "sim://"} for name in names}
    config = simulated(firmware=True).changed(devices=devices)
    assert all_pass(selftest(config)) == 9


@pytest.mark.parametrize("name", ["moteus_simulated", "dynamixel_simulated"])
def test_the_shipped_drives_pass_and_turn(name, library):
    for checks in (selftest, commission):
        all_pass(checks(load_config(Path(name))))


@pytest.fixture
def failing(monkeypatch):
    """The checks that fail on a board whose output goes through a function."""

    def run(config, change):
        def opened(config, step_s=None):
            return behind(transport(config), change)

        monkeypatch.setattr("rig.bench.logger.open_logger", opened)
        monkeypatch.setattr("rig.bench.devices.open_logger", opened)
        return [check.name for check in selftest(config) if not check.passed]

    return run


def test_a_board_whose_watchdog_sleeps_fails(monkeypatch, failing):
    encode = Profile.encode_arm

    def patient(profile, sequence, gains, limits, session):
        return encode(profile, sequence, gains, replace(limits, watchdog_us=1_000_000), session)

    monkeypatch.setattr(Profile, "encode_arm", patient)
    failed = failing(simulated(firmware=True), bytes)
    assert "the board goes to its safe state when the host is silent" in failed


def test_a_silent_board_fails_everything(failing):
    assert len(failing(simulated(), lambda data: b"")) == 6


def test_selftest_speaks_to_machines_and_names_the_tests_for_a_person(answered):
    said = answered("selftest --sim --bench")
    assert said["passed"]
    assert {"name", "passed", "detail"} == set(said["checks"][0])
    tests = bench_tests()
    assert [test["name"] for test in said["by_hand"]] == [test.name for test in tests]
    assert all(test.why and test.do and test.shows for test in tests)
    sections = [
        f"## {number}. {test.name}\n\n- Why: {test.why}\n- Do: {test.do}\n"
        f"- Must show: {test.shows}\n"
        for number, test in enumerate(tests, 1)
    ]
    assert (
        Path("docs/bench.md")
        .read_text()
        .endswith("keep it with your notes.\n\n" + "\n".join(sections))
    )


MOTOR, SPINDLE, JAW, CURRENT = 0, 1, 2, 5


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


def commissioned(bench, monkeypatch, *start):
    link = SimulatedTransport(FirmwareBoard(bench, *start), step_s=0.02)
    monkeypatch.setattr("rig.bench.logger.open_logger", lambda _: link)
    return list(commission(simulated()))


@pytest.mark.usefixtures("library")
def test_a_sound_rig_passes_both_ways(said):
    said("commission --sim")


@pytest.mark.usefixtures("library")
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
    made = commissioned(bench, monkeypatch)
    assert [check.name for check in made if not check.passed] == [failed]
    turned_rad = np.ptp(bench.spindle) * 2 * np.pi / 8192
    assert turned_rad < 2 * REACH_RAD


@pytest.mark.usefixtures("library")
def test_a_board_without_zeros_does_not_move(monkeypatch):
    bench = MiswiredBench({})
    *_, last = commissioned(bench, monkeypatch, BoardStart(simulated=False))
    assert not last.passed
    assert "rig reference" in last.detail
    assert np.ptp(bench.spindle or [0]) < 5
