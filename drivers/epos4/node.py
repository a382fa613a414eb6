"""An EPOS4 as a node: heartbeats, network state, emergencies, and the cycle of its process data.

Nothing runs in the background: frames are served, and the host's heartbeat is sent, in `idle`.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from drivers.counters import DeviceCounters
from drivers.epos4 import protocol
from drivers.epos4.faults import DriveFaultError, fault
from drivers.epos4.protocol import Feedback
from drivers.errors import FrameError, LinkTimeoutError
from drivers.transport.transport import time_left

if TYPE_CHECKING:
    from drivers.epos4.canopen_link import CanopenLink

DRIVE_HEARTBEAT_MS = 100
SILENT_S = 3.5 * DRIVE_HEARTBEAT_MS / 1000
"""Longest silence of the drive that is not a fault."""
HOST_NODE = 127
"""Node number under which the host sends its heartbeat."""
STATE_TIMEOUT_S = 0.8
BOOT_TIMEOUT_S = 3.0
INSTANT_S = 1e-9
FEEDBACK_TIMEOUT_S = 0.01
"""Time for the answer to a SYNC; it takes a fraction of a millisecond on the wire."""
SPACING = 0.4
"""Least time between two SYNCs of which one was late, in periods."""
_STATES = {
    0: "it has restarted",
    protocol.STOPPED: "it is stopped",
    protocol.PRE_OPERATIONAL: "it is pre-operational",
}


class Node:
    """What the network says of one drive.

    It stops by itself after `host_timeout_ms` of silence of the host; 0 for never.
    """

    def __init__(self, link: "CanopenLink", host_timeout_ms: int, counters: DeviceCounters) -> None:
        self._link = link
        self._bus = link.bus
        self._host_timeout_ms = host_timeout_ms
        self._counters = counters
        self._state: int | None = None
        self._booted = False
        self._heard_s = self._bus.now_s
        self._silent = False
        self._beat_s = -np.inf
        self._unreported: int | None = None
        self.last_error = 0
        """Error code of the newest emergency frame, 0 after the error is gone."""
        self.started = False
        """Whether the drive was started and is to be operational."""
        link.subscribe(0x80 + link.node_id, self._take_emergency)
        link.subscribe(0x700 + link.node_id, self._take_heartbeat)

    @property
    def in_trouble(self) -> bool:
        """Whether `require_well` will raise for an emergency or the network state."""
        return self._unreported is not None or not self._is_operational

    @property
    def _is_operational(self) -> bool:
        return self._state in (None, protocol.OPERATIONAL)

    def command(self, command: int) -> None:
        """Send a command of network management."""
        self._state = None
        self._booted = False
        self._link.send(0, bytes([command, self._link.node_id]))

    def reach(self, state: int) -> None:
        """Wait until the drive's heartbeat has this network state; errors as `wait`."""
        self.wait(f"network state {state}", lambda: self._state == state)

    def reset_communication(self) -> None:
        """Let communication objects have their stored values; wait for boot-up as `wait`."""
        self.started = False
        self.command(protocol.NMT_RESET_COMMUNICATION)
        self.wait("its boot-up", lambda: self._booted, BOOT_TIMEOUT_S)

    def forget_error(self) -> None:
        """Take the drive's error as cleared."""
        self.last_error = 0
        self._unreported = None

    def reported(self) -> None:
        """Take the newest emergency as raised already."""
        self._unreported = None

    def wait(
        self, what: str, reached: Callable[[], bool], timeout_s: float = STATE_TIMEOUT_S
    ) -> None:
        """Serve the bus until `reached` returns true; LinkTimeoutError after too long."""
        give_up_s = self._bus.now_s + timeout_s
        while not reached():
            if self._bus.now_s > give_up_s:
                raise LinkTimeoutError(
                    f"Node {self._link.node_id} did not reach {what}.",
                    f"It had {timeout_s:g} s.",
                    "Look at its error and its enable and STO inputs.",
                )
            self.idle(0.001)

    def idle(self, wait_s: float) -> None:
        """Let time pass, serving what comes and sending the host's heartbeat when it is due."""
        end_s = self._bus.now_s + wait_s
        while True:
            now_s = self._bus.now_s
            if self._host_timeout_ms and now_s - self._beat_s >= self._host_timeout_ms / 4000:
                self._link.send(0x700 + HOST_NODE, bytes([protocol.OPERATIONAL]))
                self._beat_s = now_s
            beat_in_s = self._host_timeout_ms / 4000 if self._host_timeout_ms else wait_s
            left_s = min(end_s - now_s, beat_in_s)
            came = self._link.pump(left_s if left_s > INSTANT_S else 0.0)
            if not came and self._bus.now_s >= end_s - INSTANT_S:
                return

    def require_well(self) -> None:
        """Raise when a started drive has sent an emergency or has left operation of the network.

        An emergency is raised once; the network state, which ends all samples, every time.

        Raises:
            DriveFaultError: It has.
        """
        if not self.started:
            return
        code, self._unreported = self._unreported, None
        if code is not None:
            raise fault(code)
        if self._is_operational:
            return
        if self.last_error:
            raise fault(self.last_error)
        state = _STATES.get(self._state or 0, f"its network state is {self._state}")
        raise DriveFaultError(
            f"Node {self._link.node_id} on {self._bus.url} is not operational any more: {state}.",
            "Its supply failed, or another program commands the network.",
            "Take the motor for live. Find out why, clear the fault (rig clear) and start again.",
        )

    def require_answers(self) -> None:
        """Raise when a SYNC had no answer and the drive's error or its silence is why.

        Raises:
            DriveFaultError: An error stands: it may have ended the process data.
            LinkTimeoutError: The drive's heartbeat has been missing for too long.
        """
        if self.last_error:
            raise fault(self.last_error)
        if self._bus.now_s - self._heard_s <= SILENT_S:
            self._silent = False
            return
        if not self._silent:
            self._counters.stalls += 1
        self._silent = True
        raise LinkTimeoutError(
            f"Node {self._link.node_id} on {self._bus.url} has fallen silent.",
            f"No heartbeat came for {SILENT_S:g} s.",
            "Take the motor for live. Check the drive's supply and the cable.",
        )

    def _take_heartbeat(self, data: bytes) -> None:
        self._heard_s = self._bus.now_s
        if len(data) != 1:
            self._counters.unknown_frames += 1
            return
        if data[0] == 0:
            self._booted = True
            if self.started:
                self._counters.restarts += 1
        self._state = data[0] & 0x7F

    def _take_emergency(self, data: bytes) -> None:
        try:
            code, _ = protocol.decode_emergency(data)
        except FrameError:
            self._counters.unknown_frames += 1
            return
        self.last_error = code
        if code:
            self._counters.device_errors += 1
            if self.started:
                self._unreported = code


class Cycle:
    """The process data of one drive, at a rate of SYNC of which none or some may be late."""

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
        """Send an armed drive's torque, then SYNC; return the answer, None when none comes."""
        if torque_per_mille is not None:
            self.command(protocol.ENABLE_OPERATION, torque_per_mille)
        while self._bus.now_s < self._synced_s + self._least_s:
            self._link.pump(0.0)  # not asleep: who is late already would wake up later still
        self._synced_s = self._bus.now_s
        self._link.send(0x80)
        for remaining_s in time_left(self._bus, FEEDBACK_TIMEOUT_S):
            if self._feedback is not None:
                break
            self._link.pump(remaining_s)
        feedback, self._feedback = self._feedback, None
        return feedback

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
