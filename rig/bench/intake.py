"""The next samples of a logger, waited for; its clock and its silence are noticed on the way."""

from time import sleep

import numpy as np

from drivers.clock import ClockFit
from drivers.device import Clocked
from drivers.teensy.driver import SampleBatch, TeensyLogger
from rig.bench.sensor_logger import SensorLogger
from rig.bench.trips import require_same_start
from rig.errors import ExitCode, RigError

READ_TIMEOUT_S = 0.2
"""Longest wait for the next samples, s; shorter than the logger's watchdog, fed in between."""

GATHER_S = 0.01
"""In real time samples gather this long between two readings, s: a block costs as much as one."""

CLOCK_EVERY_S = 0.25
"""How often a reading follows the one before at once, so that the clock's answer is not kept, s."""

STALL_S = 1.0
"""With no sample for this long, the logger is taken for dead, s."""


class LoggerStalledError(RigError):
    """The logger sends nothing although it should stream."""

    exit_code = ExitCode.DEVICE


class Intake:
    """Takes in the samples of a logger that streams; the way to it has its clock.

    With `gathers` samples come by themselves, as time passes.
    """

    def __init__(self, logger: TeensyLogger | SensorLogger, way: Clocked, gathers: bool) -> None:
        self._logger = logger
        self._way = way
        self._gathers = gathers
        self._read_s = self._clock_due_s = -np.inf
        self.clock = ClockFit()
        """The logger's clock against this computer's; its line states the residual of the fit."""

    def next(self, boot: int) -> SampleBatch:
        """Give the logger a sign of life, and return its next samples, one or more.

        They are of the board's start with the number `boot`.

        Raises:
            BoardResetError: The board was restarted, and sends nothing.
            LoggerStalledError: The logger sends nothing.
        """
        self._gather()
        self._logger.heartbeat()
        give_up_s = self._way.now_s + STALL_S
        while not len((batch := self._logger.read(READ_TIMEOUT_S)).samples):
            if self._way.now_s > give_up_s:
                require_same_start(self._logger, boot)
                raise LoggerStalledError(
                    f"The logger has sent nothing for {STALL_S:g} s.",
                    "Its cable was pulled, it was reset, or its program stopped.",
                    "Check the cable and its supply, then start again; nothing recorded is lost.",
                )
        exchange = self._logger.last_exchange
        if exchange is not None:
            self.clock.add(exchange.sent_s, exchange.received_s, exchange.tick_us)
        return batch

    def _gather(self) -> None:
        """Let samples gather where time is real and the board runs by itself."""
        now_s = self._way.now_s
        if now_s >= self._clock_due_s:
            self._clock_due_s = now_s + CLOCK_EVERY_S
        elif self._gathers:
            sleep(max(0.0, self._read_s + GATHER_S - now_s))
        self._read_s = self._way.now_s
