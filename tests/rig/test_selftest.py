"""The acceptance test of a bench: on fakes here, on a real one where RIG_BENCH names it."""

import os
from dataclasses import replace
from pathlib import Path

import pytest

from drivers.teensy.profile import Profile
from drivers.transport.simulated import SimulatedTransport
from rig.configuration.check import refuse_problems
from rig.configuration.config import Config, load_config
from rig.doctor.bench import bench_tests, page
from rig.doctor.selftest import selftest
from tests.rig.simulated import Wrapped, simulated, transport

pytestmark = pytest.mark.integration


@pytest.mark.bench
def test_the_bench_passes_its_acceptance_test():
    named = os.environ.get("RIG_BENCH")
    if named is None:
        pytest.skip("no bench: set RIG_BENCH to a configuration, as for `rig selftest -c`")
    config = load_config(Path(named))
    refuse_problems(config)
    checks = list(selftest(config))
    assert checks
    assert all(check.passed for check in checks), [c for c in checks if not c.passed]


@pytest.mark.parametrize("names", [("usb520", "ati-can", "amt21"), ("qia128", "ati-net", "epos4")])
def test_the_simulated_rig_passes_with_every_kind_of_device(names, library):
    devices = {name.replace("-", "_"): {"driver": name, "url": "sim://"} for name in names}
    config = simulated(firmware=True).changed(devices=devices)
    checks = list(selftest(config))
    assert len(checks) == 9
    assert all(check.passed for check in checks), [c for c in checks if not c.passed]


def failing(config: Config, monkeypatch: pytest.MonkeyPatch, change: object) -> list[str]:
    """The checks that fail on a board whose output goes through a function."""

    def opened(config: Config, step_s: float | None = None) -> SimulatedTransport:
        link = transport(config)
        return SimulatedTransport(Wrapped(link.board, lambda data: change(link.board, data)))

    monkeypatch.setattr("rig.bench.logger.open_logger", opened)
    monkeypatch.setattr("rig.bench.devices.open_logger", opened)
    return [check.name for check in selftest(config) if not check.passed]


def test_a_board_whose_watchdog_sleeps_fails(monkeypatch):
    encode = Profile.encode_arm

    def patient(profile, sequence, gains, limits, session):
        return encode(profile, sequence, gains, replace(limits, watchdog_us=1_000_000), session)

    monkeypatch.setattr(Profile, "encode_arm", patient)
    failed = failing(simulated(firmware=True), monkeypatch, lambda board, data: data)
    assert "the board goes to its safe state when the host is silent" in failed


def test_a_silent_board_fails_everything(monkeypatch):
    assert len(failing(simulated(), monkeypatch, lambda board, data: b"")) == 6


def test_selftest_speaks_to_machines(answered):
    told = answered("selftest")
    assert told["passed"]
    assert {"name", "passed", "detail"} == set(told["checks"][0])


def test_the_tests_for_a_person_are_named_and_are_those_of_the_page(answered):
    said = answered("selftest --sim --bench")
    tests = bench_tests()
    assert [test["name"] for test in said["by_hand"]] == [test.name for test in tests]
    assert all(test.why and test.do and test.shows for test in tests)
    assert Path("docs/bench.md").read_text() == page()
