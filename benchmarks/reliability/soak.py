"""An hour of virtual time with the firmware in the loop; real time on a pty and on a CAN bus."""

import os
import time
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from drivers.transport.transport import Transport
from rig.bench.logger import is_real_time, open_logger
from rig.bench.session import Session
from rig.configuration.config import load_config
from rig.errors import SafetyTripError

PERIOD_S = 4.0
BLOCK_S = 60.0
WATCHDOG_S = 0.05
"""That of the shipped configurations of real rigs."""


@dataclass(frozen=True)
class Soak:
    """Result of a soak test.

    Attributes:
        duration_s: Time of the rig, s.
        troubles: Counters of the link that are not 0, in words.
        processor_ratio: Processor time of this process over real time.
        latency_ms: Percentiles 50, 99, 99.9 and 100 of the time from a sample's tick to its being
            read and converted; None where time is virtual or nothing was read.
        trip: What ended it before its time; empty for nothing.
        pause_ms: Longest time between two commands of the host; of it, the time this program
            computed, and the time it waited for a processor.
    """

    where: str
    duration_s: float
    samples: int
    lost: int
    troubles: str
    elapsed_s: float
    processor_ratio: float
    latency_ms: tuple[float, ...] | None
    trip: str
    pause_ms: tuple[float, float, float]


class Paced:
    """A transport that keeps the longest pause between two commands, while it watches."""

    def __init__(self, transport: Transport) -> None:
        self._transport = transport
        self._last = _times_ms()
        self.longest_ms = (0.0, 0.0, 0.0)
        self.watches = False

    def __getattr__(self, name: str) -> Any:
        """Return an attribute of the transport."""
        return getattr(self._transport, name)

    def write(self, data: bytes) -> None:
        """Write, and keep the pause before it."""
        now = _times_ms()
        pause = now[0] - self._last[0], now[1] - self._last[1], now[2] - self._last[2]
        if self.watches:
            self.longest_ms = max(self.longest_ms, pause)
        self._last = now
        self._transport.write(data)


def _times_ms() -> tuple[float, float, float]:
    """Return real time, time computed and time waited for a processor (Linux), ms."""
    ran_ns, waited_ns, _ = os.pread(_schedule(), 100, 0).split()
    return 1e3 * time.monotonic(), 1e-6 * int(ran_ns), 1e-6 * int(waited_ns)


@cache
def _schedule() -> int:
    """Open what the kernel counts of this thread, once: reading it must cost next to nothing."""
    return os.open("/proc/self/schedstat", os.O_RDONLY)


def soak(config_name: str, duration_s: float, where: str) -> Soak:
    """Play slow grasps for a while, a block of a minute after another."""
    config = load_config(Path(config_name))
    real = is_real_time(config)
    load_a = min(0.2, config.reference_limits.load_command_a)
    config = config.changed(safety={"watchdog_s": WATCHDOG_S})
    late_ms: list[np.ndarray] = []
    samples, lost, trip = 0, 0, ""
    link = Paced(open_logger(config))
    with Session(config, link) as session:
        next(session.rest(0.5))
        began_s, busy_s = time.monotonic(), time.process_time()
        start, blocks = session.here[0], round(duration_s / BLOCK_S)
        phase = 2 * np.pi * np.arange(round(1000 * BLOCK_S)) / (1000 * PERIOD_S)
        try:
            session.settle()
            began_s, busy_s = time.monotonic(), time.process_time()
            for _ in range(max(1, blocks)):
                link.watches = False
                grasps = start + 0.3 * (1 - np.cos(phase))
                for reading in session.play(grasps, np.full(phase.size, load_a)):
                    link.watches = True  # from the first motion of a block on
                    samples += len(reading)
                    lost = reading.lost
                    if real:  # the process stamps by the clock this program reads, in 32 bits
                        now_us = time.monotonic_ns() // 1000
                        ticks = reading.counts["tick_us"].astype(np.int64)
                        late_ms.append(((now_us - ticks) % 2**32) / 1000)
        except SafetyTripError as error:
            trip = f"{error.what} ({samples / 1000:.0f} s)"
        elapsed_s = time.monotonic() - began_s
        busy_s = time.process_time() - busy_s
        counters = session.counters
    told = {name: count for name, count in counters.items() if count and name != "frames"}
    return Soak(
        where,
        samples / 1000,
        samples,
        lost,
        ", ".join(f"{count} {name}" for name, count in told.items()) or "none",
        elapsed_s,
        busy_s / elapsed_s,
        tuple(np.percentile(np.concatenate(late_ms), [50, 99, 99.9, 100])) if late_ms else None,
        trip,
        link.longest_ms,
    )
