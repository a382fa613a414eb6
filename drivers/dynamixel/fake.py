"""A Dynamixel XL330-M288 that takes and gives the bytes a real one would, a rotor on its horn.

Not modelled: the time bytes take, profiles and gains, and every mode but current control.
"""

from drivers.device import Device
from drivers.dynamixel import protocol
from drivers.dynamixel.driver import Dynamixel
from drivers.dynamixel.protocol import Present, Register
from drivers.errors import FrameError
from drivers.transport.faulty import Faults, FaultyTransport
from drivers.transport.simulated import Outbox, SimulatedTransport

XL330_M288 = 1200
DEVICE_ID = 1
"""It stays silent for any other."""
ROM_END = 64
"""Registers below can be written only while the motor is out of force."""
_GOALS = range(100, 120)
_COUNTS_S_PER_UNIT = 0.229 * protocol.COUNTS_A_TURN / 60
_ACCELERATION, _FRICTION = 40.0, 4.0
"""Speed units gained in a second by a unit of current, and lost by a unit of speed."""


class DynamixelFake(Outbox):
    """A drive, with the interface of `drivers.transport.simulated.Board`."""

    def __init__(self, model: int = XL330_M288, echo: bool = False) -> None:
        super().__init__()
        self._model = model
        self._echo = echo
        self._held = b""
        self._silent_ms = 0
        self._speed = self._position = 0.0
        self.table = bytearray(256)
        self._reset()

    def receive(self, data: bytes) -> None:
        """Carry out the instructions for this drive."""
        if self._echo:
            self._out += data
        self._held += data
        while (found := protocol.find(self._held)) is not None:
            packet, self._held = found
            try:
                device_id, instruction, parameters = protocol.decode(packet)
            except FrameError:
                continue
            if device_id == DEVICE_ID and instruction != protocol.STATUS:
                self._silent_ms = 0
                self._carry_out(instruction, parameters)

    def advance(self, ticks: int) -> None:
        """Let the rotor turn for `ticks` milliseconds."""
        for _ in range(ticks):
            self._silent_ms += 1
            limit_ms = self.table[protocol.BUS_WATCHDOG.address] * protocol.WATCHDOG_UNIT_MS
            if self.in_force and limit_ms and self._silent_ms > limit_ms:
                self.table[protocol.BUS_WATCHDOG.address] = protocol.WATCHDOG_TRIPPED
                self._put(protocol.GOAL_CURRENT, 0)
            gained = self.current * _ACCELERATION - self._speed * _FRICTION
            self._speed += 1e-3 * gained
            self._position += 1e-3 * self._speed * _COUNTS_S_PER_UNIT
        values = Present(self.current, round(self._speed), round(self._position), 50, 31)
        at = protocol.PRESENT.address
        self.table[at : at + protocol.PRESENT.size] = protocol.encode_present(values)

    @property
    def in_force(self) -> bool:
        """Whether its motor is energised."""
        return bool(self.table[protocol.TORQUE_ENABLE.address])

    @property
    def current(self) -> int:
        """Motor current, units of 1 mA."""
        goal = protocol.GOAL_CURRENT
        raw = self.table[goal.address : goal.address + goal.size]
        return int.from_bytes(raw, "little", signed=True) if self.in_force else 0

    def fail(self, bits: int) -> None:
        """Let a hardware error happen: alert, motor out of force."""
        self.table[protocol.HARDWARE_ERROR.address] = bits
        self.table[protocol.TORQUE_ENABLE.address] = 0

    def _reset(self) -> None:
        self.table[:] = bytes(256)
        self._put(Register(0, 2), self._model)
        self._put(Register(6, 1), 52)
        self._put(protocol.OPERATING_MODE, 3)
        self._put(protocol.CURRENT_LIMIT, 1750)
        self.advance(0)

    def _put(self, register: Register, value: int) -> None:
        data = value.to_bytes(register.size, "little")
        self.table[register.address : register.address + register.size] = data

    def _carry_out(self, instruction: int, parameters: bytes) -> None:
        address = int.from_bytes(parameters[:2], "little")
        if instruction == protocol.PING:
            self._answer(0, bytes([*self.table[0:2], self.table[6]]))
        elif instruction == protocol.READ and len(parameters) == 4:
            size = int.from_bytes(parameters[2:], "little")
            self._answer(0, bytes(self.table[address : address + size]))
        elif instruction == protocol.WRITE and len(parameters) > 2:
            self._answer(self._write(address, parameters[2:]))
        elif instruction == protocol.REBOOT:
            self._answer(0)
            self._reset()
        else:
            self._answer(2)

    def _write(self, address: int, data: bytes) -> int:
        tripped = self.table[protocol.BUS_WATCHDOG.address] == protocol.WATCHDOG_TRIPPED
        if address in _GOALS and tripped:
            return protocol.RANGE_ERROR
        if address < ROM_END and self.in_force:
            return protocol.ACCESS_ERROR
        if address == protocol.OPERATING_MODE.address and data[0] not in (0, 1, 3, 4, 5, 16):
            return protocol.RANGE_ERROR
        if address == protocol.GOAL_CURRENT.address:
            limit = int.from_bytes(self.table[38:40], "little")
            if abs(int.from_bytes(data, "little", signed=True)) > limit:
                return 6
        self.table[address : address + len(data)] = data
        return 0

    def _answer(self, error: int, parameters: bytes = b"") -> None:
        alert = protocol.ALERT if self.table[protocol.HARDWARE_ERROR.address] else 0
        body = bytes([error | alert]) + parameters
        self._out += protocol.encode(DEVICE_ID, protocol.STATUS, body)


def open_fake(faults: Faults) -> Device:
    """Open the driver on a fake drive behind a cable with faults."""
    line = SimulatedTransport(DynamixelFake(), "sim://dynamixel")
    return Dynamixel(FaultyTransport(line, faults))
