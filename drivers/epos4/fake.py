"""An EPOS4 with the frames of a real one, on the library's own CANopen server.

Errors act as in maxon's firmware specification (chapter 7 and objects 0x6007, 0x605E, 0x1029, as
transcribed in the public library `Imcab/EposLib`): a lost heartbeat stops the drive as 0x6007 says
and takes the node out of "operational", so that process data end; a fault reset is ignored until an
NMT "reset communication", which brings the communication objects back to their stored values.

Not modelled: the times its controllers and the wire take, its inputs, homing, and every mode but
cyclic torque. Averaged torque follows the target at once. A quick stop's ramp is a time in which
the power stage stays on.
"""

import math
import struct
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import canopen
from canopen.sdo.exceptions import SdoAbortedError

from drivers.device import Device
from drivers.epos4 import protocol
from drivers.epos4.dictionary import object_dictionary
from drivers.epos4.driver import Epos4
from drivers.epos4.protocol import State
from drivers.transport.can_bus import CanFrame
from drivers.transport.faulty import Faults, FaultyCanBus
from drivers.transport.simulated_can import SimulatedCanBus

Motor = Callable[[float, int], int]
"""Moves the motor by a torque, N m, for some milliseconds; returns its position, counts."""

WRONG_STATE, NOT_THERE, OUT_OF_RANGE = 0x08000022, 0x06020000, 0x06090030
HOST_LOST, BUS_PASSIVE = 0x8130, 0x8120
RAMP_MS = 200
"""Time a quick stop takes."""
_COMMUNICATION = range(0x8100, 0x8300)
"""Error codes that 0x6007 decides on."""
_ALLOWED = {(0x6007, 0): (2, 3), (0x605E, 0): (0, 1, 2), (0x1029, 1): (0, 1, 2)}
_AFTER_LOST_HOST = {0: "PRE-OPERATIONAL", 2: "STOPPED"}
_RESET_NODE, _RESET_COMMUNICATION = 0x81, 0x82
_LOW = {
    State.SWITCH_ON_DISABLED: 0x40,
    State.READY: 0x31,
    State.SWITCHED_ON: 0x33,
    State.OPERATION_ENABLED: 0x37,
    State.QUICK_STOP: 0x17,
    State.FAULT_REACTION: 0x1F,
    State.FAULT: 0x08,
}


class FrameNetwork(canopen.Network):
    """Keeps the frames to be sent; what is periodic comes by ticks."""

    def __init__(self) -> None:
        super().__init__()
        self.out: list[CanFrame] = []
        self.tasks: list[Periodic] = []

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        """Keep a frame."""
        self.out.append(CanFrame(can_id, bytes(data)))

    def send_periodic(  # type: ignore[override]
        self, can_id: int, data: bytes, period: float, remote: bool = False
    ) -> "Periodic":
        """Send a frame every `period` seconds from now on."""
        task = Periodic(self, can_id, data, round(period * 1000))
        self.tasks.append(task)
        return task

    def advance(self) -> None:
        """Let 1 ms pass."""
        for task in self.tasks:
            task.advance()


@dataclass(eq=False)
class Periodic:
    """A frame that is sent again and again."""

    network: FrameNetwork
    can_id: int
    data: bytes
    period_ms: int
    elapsed_ms: int = 0

    def advance(self) -> None:
        """Let 1 ms pass."""
        self.elapsed_ms += 1
        if self.elapsed_ms >= self.period_ms:
            self.elapsed_ms = 0
            self.network.send_message(self.can_id, self.data)

    def update(self, data: bytes) -> None:
        """Change what is sent."""
        self.data = data

    def stop(self) -> None:
        """Send it no more."""
        self.network.tasks.remove(self)


class FreeMotor:
    """A rotor with viscous friction and nothing on its shaft."""

    INERTIA_KG_M2, FRICTION_N_M_S, COUNTS_A_TURN = 2.72e-7, 2e-5, 4096

    def __init__(self) -> None:
        self._speed = 0.0
        self._angle = 0.0

    def __call__(self, torque_n_m: float, ticks: int) -> int:
        """Move for `ticks` milliseconds and return the position, counts."""
        step = 1e-3 / (self.INERTIA_KG_M2 + 1e-3 * self.FRICTION_N_M_S)
        for _ in range(ticks):
            self._speed += (torque_n_m - self.FRICTION_N_M_S * self._speed) * step
            self._angle += self._speed * 1e-3
        return round(self._angle * (self.COUNTS_A_TURN / math.tau))


class Epos4Fake:
    """A drive, with the interface of `drivers.transport.simulated_can.CanNode`."""

    def __init__(
        self,
        node_id: int = 1,
        motor: Motor | None = None,
        objects: dict[tuple[int, int], int] | None = None,
        absent: tuple[int, ...] = (),
    ) -> None:
        self._motor = motor or FreeMotor()
        self._absent = absent
        self._network = FrameNetwork()
        self._node = canopen.LocalNode(node_id, object_dictionary())
        self._network[node_id] = self._node
        self._id = node_id
        self._position = 0
        self._host_silent_ms: int | None = None
        self.state = State.SWITCH_ON_DISABLED
        """Where its state machine is."""
        self._ramp_ms = 0
        self._factory = _factory(node_id) | (objects or {})
        self._restart(_RESET_NODE)
        self._node.add_write_callback(self._written)  # type: ignore[no-untyped-call]
        self._node.add_read_callback(self._asked)  # type: ignore[no-untyped-call]
        self._network.subscribe(0x80, lambda *_: self._synchronise())

    # drivers.transport.simulated_can.CanNode

    def receive(self, frame: CanFrame) -> None:
        """Take a frame from the bus."""
        if frame.extended:
            return
        if self._node.nmt.state == "STOPPED" and frame.can_id:
            return
        if frame.can_id == 0x700 + self._host_node and self._host_limit_ms:
            self._host_silent_ms = 0
        if frame.can_id == self._word(0x1400, 1) and self._operational:
            self._take_process_data(frame.data)
        self._network.notify(frame.can_id, bytearray(frame.data), 0.0)
        if frame.can_id == 0 and frame.data[1:2] in (b"\0", bytes([self._id])):
            self._restart(frame.data[0])

    def advance(self, ticks: int) -> None:
        """Let the motor move and heartbeats come for `ticks` milliseconds."""
        for _ in range(ticks):
            self._position = self._motor(self.torque_n_m, 1)
            self._network.advance()
            if self._host_silent_ms is not None:
                self._host_silent_ms += 1
                if self._host_limit_ms and self._host_silent_ms > self._host_limit_ms:
                    self._host_silent_ms = None
                    self.fail(HOST_LOST, 0x10)
            if self.state is State.FAULT_REACTION:
                self._ramp_ms -= 1
                if self._ramp_ms <= 0:
                    self.state = State.FAULT

    def transmit(self) -> list[CanFrame]:
        """Give the frames to be sent."""
        out, self._network.out = self._network.out, []
        return out

    # controls and observations for tests

    @property
    def torque_n_m(self) -> float:
        """Torque of the motor."""
        if self.state is not State.OPERATION_ENABLED:
            return 0.0
        return self._integer(0x6071) * 1e-3 * self._word(0x6076) * 1e-6

    def fail(self, code: int, register: int = 1) -> None:
        """Let an error happen: emergency frame, the reaction set for it, fault."""
        communication = code in _COMMUNICATION
        ramp = self._word(0x6007) == 3 if communication else self._word(0x605E) != 0
        if ramp and self.state is State.OPERATION_ENABLED:
            self.state, self._ramp_ms = State.FAULT_REACTION, RAMP_MS
        else:
            self.state = State.FAULT
        self._store(0x603F, 0, code)
        self._store(0x1001, 0, register)
        self._node.emcy.send(code, register)
        if code in (HOST_LOST, BUS_PASSIVE):
            self._needs_communication_reset = True
        if code == HOST_LOST and self._operational:
            after = _AFTER_LOST_HOST.get(self._word(0x1029, 1))
            if after:
                self._node.nmt.state = after

    # state machine and objects

    def _asked(self, index: int, subindex: int, **_: Any) -> int | None:
        if index in self._absent:
            raise SdoAbortedError(NOT_THERE)
        if index == 0x6041:
            return _LOW[self.state] | (0x200 if self._operational else 0)
        if index == 0x6064:
            return self._position
        if index in (0x6077, 0x30D2) and (index, subindex) != (0x30D2, 0):
            return self._integer(0x6071) if self.state is State.OPERATION_ENABLED else 0
        return None

    def _written(self, index: int, subindex: int, data: bytes, **_: Any) -> None:
        if index in self._absent:
            raise SdoAbortedError(NOT_THERE)
        value = int.from_bytes(data, "little")
        if value not in _ALLOWED.get((index, subindex), (value,)):
            raise SdoAbortedError(OUT_OF_RANGE)
        mapping = index & 0xFFFC in (0x1400, 0x1600, 0x1800, 0x1A00)
        if mapping and self._node.nmt.state != "PRE-OPERATIONAL":
            raise SdoAbortedError(WRONG_STATE)
        if index & 0xFFFC in (0x1600, 0x1A00) and subindex:
            number = index & 3
            communication = (0x1400 if index < 0x1A00 else 0x1800) + number
            if not self._word(communication, 1) & protocol.PDO_INVALID or self._word(index, 0):
                raise SdoAbortedError(WRONG_STATE)
        if index == 0x6040:
            self._command(value)
        elif index == 0x6060:
            self._store(0x6061, 0, value)
        elif index == 0x1016:
            self._host_node, self._host_limit_ms = value >> 16 & 0x7F, value & 0xFFFF
            self._host_silent_ms = None

    def _command(self, controlword: int) -> None:
        before, reset = self._word(0x6040), protocol.FAULT_RESET
        if self.state is State.FAULT_REACTION:
            return
        if self.state is State.FAULT:
            if self._needs_communication_reset:
                return
            if controlword & reset and not before & reset:
                self.state = State.SWITCH_ON_DISABLED
                self._store(0x603F, 0, 0)
                self._store(0x1001, 0, 0)
                self._node.emcy.reset()
        elif not controlword & 0x02 or not controlword & 0x04:
            self.state = State.SWITCH_ON_DISABLED
        elif not controlword & 0x01:
            self.state = State.READY
        elif self.state in (State.READY, State.SWITCHED_ON, State.OPERATION_ENABLED):
            enabled = controlword & 0x08
            self.state = State.OPERATION_ENABLED if enabled else State.SWITCHED_ON

    def _restart(self, command: int) -> None:
        """Follow an NMT reset: stored values again, boot-up, and pre-operational by itself."""
        if command not in (_RESET_NODE, _RESET_COMMUNICATION):
            return
        stored = self._factory
        if command == _RESET_COMMUNICATION:
            stored = {at: value for at, value in stored.items() if at[0] < 0x2000}
        else:
            self.state = State.SWITCH_ON_DISABLED
        for (index, subindex), value in stored.items():
            self._store(index, subindex, value)
        self._needs_communication_reset = False
        self._host_node = self._host_limit_ms = 0
        self._host_silent_ms = None
        self._node.nmt.state = "INITIALISING"  # reports that it has booted
        self._node.nmt.state = "PRE-OPERATIONAL"

    @property
    def _operational(self) -> bool:
        return bool(self._node.nmt.state == "OPERATIONAL")

    def _synchronise(self) -> None:
        cob_id = self._word(0x1800, 1)
        if not self._operational or cob_id & protocol.PDO_INVALID:
            return
        data = b""
        for place in range(1, self._word(0x1A00, 0) + 1):
            entry = self._word(0x1A00, place)
            data += self._node.get_data(entry >> 16, entry >> 8 & 0xFF)[: (entry & 0xFF) // 8]
        self._network.send_message(cob_id, data)

    def _take_process_data(self, data: bytes) -> None:
        for place in range(1, self._word(0x1600, 0) + 1):
            entry = self._word(0x1600, place)
            size = (entry & 0xFF) // 8
            self._node.set_data(entry >> 16, entry >> 8 & 0xFF, data[:size])
            data = data[size:]

    def _store(self, index: int, subindex: int, value: int) -> None:
        variable = self._node.object_dictionary.get_variable(index, subindex)
        assert variable is not None, f"{index:#x}:{subindex}"  # noqa: S101
        self._node.data_store.setdefault(index, {})[subindex] = variable.encode_raw(value)

    def _word(self, index: int, subindex: int = 0) -> int:
        return int.from_bytes(self._node.data_store[index][subindex], "little")

    def _integer(self, index: int) -> int:
        value: int = struct.unpack("<h", self._node.data_store[index][0])[0]
        return value


def _factory(node_id: int) -> dict[tuple[int, int], int]:
    """Return the objects a drive comes with: a motor of 700 mA and 17.8 mN m/A."""
    objects = {
        (0x1000, 0): 0x00020192, (0x1001, 0): 0, (0x1016, 0): 1, (0x1016, 1): 0, (0x1017, 0): 0,
        (0x1018, 0): 4, (0x1018, 1): protocol.VENDOR_ID, (0x1018, 2): 0x63500000,
        (0x1018, 3): 0x01700000, (0x1018, 4): 0x00C0FFEE, (0x1029, 0): 1, (0x1029, 1): 0,
        (0x3001, 1): 700, (0x3001, 2): 1400, (0x3001, 3): 1, (0x3001, 4): 86, (0x3001, 5): 17_800,
        (0x6007, 0): 3, (0x603F, 0): 0, (0x605E, 0): 2, (0x6040, 0): 0, (0x6060, 0): 0,
        (0x6061, 0): 0, (0x6071, 0): 0, (0x6076, 0): 12_460, (0x6502, 0): 0x3A5,
    }  # fmt: skip
    for number in range(4):
        for communication, mapping, cob in ((0x1400, 0x1600, 0x200), (0x1800, 0x1A00, 0x180)):
            objects[communication + number, 1] = cob + 0x100 * number + node_id
            objects[communication + number, 2] = protocol.EVENT_DRIVEN
            objects[mapping + number, 0] = 0
    return objects


def open_fake(faults: Faults) -> Device:
    """Open the driver on a fake drive behind a cable with faults."""
    return Epos4(FaultyCanBus(SimulatedCanBus([Epos4Fake()]), faults))
