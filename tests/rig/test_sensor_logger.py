"""A device without motors where a rig has its logger: its rate."""

import numpy as np
import pytest

from drivers.device import Batch, Channel, DeviceIdentity
from drivers.errors import DriverError
from rig.bench.sensor_logger import SensorLogger, SensorWay

DECLARED_HZ = 100.0


class Cell:
    """A load cell that sends at a rate of its own, by a clock that the test sets."""

    name = "cell"
    channels = (Channel("force_n", "N", DECLARED_HZ, -10.0, 10.0, "load"),)
    counters: dict[str, int] = {}  # noqa: RUF012

    def __init__(self, rate_hz: float) -> None:
        self.rate_hz = rate_hz
        self.now_s = 0.0
        self.made, self.sent = 0.0, 0

    def identify(self) -> DeviceIdentity:
        return DeviceIdentity("cell", "1", "")

    def start(self) -> None: ...
    def stop(self) -> None: ...
    def close(self) -> None: ...

    def read(self, timeout_s: float) -> Batch:
        self.now_s += 0.05
        self.made += 0.05 * self.rate_hz
        numbers = np.arange(self.sent, int(self.made + 1e-6), dtype=np.int64)
        self.sent += numbers.size
        flags = np.zeros(numbers.size, np.uint8)
        values = {"force_n": np.ones(numbers.size)}
        return Batch(values, np.full(numbers.size, self.now_s), "host", numbers, flags, 0)


def logger_of(cell, monkeypatch, is_simulated=False):
    monkeypatch.setattr("rig.bench.sensor_logger.monotonic", lambda: cell.now_s)
    logger = SensorLogger(SensorWay(cell, "cell:", is_simulated))
    logger.identify()
    return logger


def read_for(logger, cell, seconds):
    end_s = cell.now_s + seconds
    while cell.now_s < end_s:
        logger.read(0.1)


@pytest.mark.parametrize("rate_hz", [50.0, 110.0])
def test_a_rate_that_is_not_the_declared_one_is_refused(monkeypatch, rate_hz):
    cell = Cell(rate_hz)
    with pytest.raises(DriverError, match=r"cell sends [\d.]+ Hz; 100 Hz is configured"):
        read_for(logger_of(cell, monkeypatch), cell, 10.0)


@pytest.mark.parametrize("rate_hz", [99.0, 100.0, 102.0])
def test_a_rate_near_the_declared_one_is_taken(monkeypatch, rate_hz):
    cell = Cell(rate_hz)
    read_for(logger_of(cell, monkeypatch), cell, 60.0)


def test_a_rate_that_changes_later_is_refused(monkeypatch):
    cell = Cell(100.0)
    logger = logger_of(cell, monkeypatch)
    read_for(logger, cell, 30.0)
    cell.rate_hz = 80.0
    with pytest.raises(DriverError, match="cell sends"):
        read_for(logger, cell, 15.0)


def test_samples_lost_while_nobody_reads_are_not_another_rate(monkeypatch):
    cell = Cell(100.0)
    logger = logger_of(cell, monkeypatch)
    read_for(logger, cell, 4.0)
    cell.now_s += 30.0
    read_for(logger, cell, 20.0)


def test_virtual_time_is_by_the_declared_rate(monkeypatch):
    cell = Cell(50.0)
    read_for(logger_of(cell, monkeypatch, is_simulated=True), cell, 20.0)
