"""One cycle of an EPOS4: command and SYNC go out, its process data come back."""

from typing import TYPE_CHECKING

import numpy as np

from drivers.counters import DeviceCounters
from drivers.epos4 import protocol
from drivers.epos4.node import INSTANT_S
from drivers.epos4.protocol import Feedback
from drivers.errors import FrameError

if TYPE_CHECKING:
    from drivers.epos4.canopen_link import CanopenLink

FEEDBACK_TIMEOUT_S = 0.01
"""Time for the answer to a SYNC; it takes a fraction of a millisecond on the wire."""
SPACING = 0.4
"""Least time between two SYNCs of which one was late, in periods."""


class Cycle:
    """The process data of one drive.

    Args:
        link: The way to it.
        rate_hz: How often SYNC is sent.
        late_s: How late a SYNC may be; 0 where none is sent late.
        counters: Where damaged and late answers are counted.
    """

    def __init__(
        self, link: "CanopenLink", rate_hz: float, late_s: float, counters: DeviceCounters
    ) -> None:
        self._link = link
        self._bus = link.bus
        self._least_s = SPACING / rate_hz if late_s else 0.0
        self._counters = counters
        self._synced_s = -np.inf
        self._feedback: Feedback | None = None
        link.subscribe(0x180 + link.node_id, self._take_feedback)

    def exchange(self, torque_per_mille: int | None) -> Feedback | None:
        """Send SYNC and return the answer, None when there is none in time.

        Args:
            torque_per_mille: Torque that an armed drive is commanded; None for no command.
        """
        if torque_per_mille is not None:
            self.command(protocol.ENABLE_OPERATION, torque_per_mille)
        while self._bus.now_s < self._synced_s + self._least_s:
            self._link.pump(0.0)  # not asleep: who is late already would wake up later still
        self._synced_s = self._bus.now_s
        self._link.send(0x80)
        give_up_s = self._bus.now_s + FEEDBACK_TIMEOUT_S
        while True:
            feedback, self._feedback = self._feedback, None
            remaining_s = give_up_s - self._bus.now_s
            if feedback is not None or remaining_s <= INSTANT_S:
                return feedback
            self._link.pump(remaining_s)

    def command(self, controlword: int, torque_per_mille: int) -> None:
        """Send a controlword and a target torque; the drive takes them at once."""
        data = protocol.encode_command(controlword, torque_per_mille)
        self._link.send(0x200 + self._link.node_id, data)

    def drop_late(self) -> None:
        """Drop an answer that nobody waits for: it is to a SYNC that was given up."""
        if self._feedback is not None:
            self._counters.late += 1
        self._feedback = None

    def _take_feedback(self, data: bytes) -> None:
        try:
            feedback = protocol.decode_feedback(data)
            protocol.state_of(feedback.statusword)
        except FrameError:
            self._counters.unknown_frames += 1
            return
        if self._feedback is not None:
            self._counters.late += 1
        self._feedback = feedback
