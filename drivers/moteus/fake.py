"""A moteus behind an fdcanusb that takes and gives the lines a real one would, a rotor on it.

Not modelled: the bus and its times, position and velocity control, and the damping of the timeout.
"""

import math

from drivers.device import Device
from drivers.errors import FrameError
from drivers.moteus import protocol
from drivers.moteus.driver import Moteus
from drivers.moteus.protocol import State
from drivers.transport.faulty import Faults, FaultyTransport
from drivers.transport.simulated import Outbox, SimulatedTransport

DEVICE_ID = 1
"""It stays silent for any other."""
PREPARES_MS = 20
"""Time between stopped and position mode, in which it measures its current sensors."""
_INERTIA_KG_M2, _FRICTION_N_M_S = 1e-5, 2e-4
_TORQUE_CONSTANT_N_M_A = 0.03
_MEASURED = 4


class MoteusFake(Outbox):
    """A controller and its fdcanusb, with `drivers.transport.simulated.Board`'s interface."""

    def __init__(self) -> None:
        super().__init__()
        self._held = b""
        self._speed_rad_s = self._angle_rad = 0.0
        self._valid_ms = math.inf
        self._prepares_ms = 0
        self._command: dict[int, float] = {}
        self.mode = protocol.STOPPED
        self.fault = 0

    def receive(self, data: bytes) -> None:
        """Take lines; a frame to this controller is carried out and answered."""
        self._held += data
        while b"\n" in self._held:
            line, _, self._held = self._held.partition(b"\n")
            self._out += b"OK\r\n"
            try:
                frame = protocol.decode_line(line)
                if frame is not None and frame[0] & 0x7F == DEVICE_ID:
                    self._carry_out(frame[1])
            except FrameError:
                continue

    def advance(self, ticks: int) -> None:
        """Let the rotor turn for `ticks` milliseconds."""
        for _ in range(ticks):
            if self.mode in (protocol.POSITION_MODE, _MEASURED):
                self._valid_ms -= 1
                if self._valid_ms < 0:
                    self.mode = protocol.TIMEOUT
            if self.mode == _MEASURED:
                self._prepares_ms -= 1
                if self._prepares_ms <= 0:
                    self.mode = protocol.POSITION_MODE
            torque_n_m = self.torque_n_m - _FRICTION_N_M_S * self._speed_rad_s
            self._speed_rad_s += 1e-3 * torque_n_m / _INERTIA_KG_M2
            self._angle_rad += 1e-3 * self._speed_rad_s

    @property
    def torque_n_m(self) -> float:
        """Torque at the output."""
        if self.mode != protocol.POSITION_MODE:
            return 0.0
        most = self._command.get(protocol.COMMAND + 5, math.inf)
        wanted = self._command.get(protocol.COMMAND + 2, 0.0)
        return max(-most, min(most, wanted))

    def fail(self, code: int) -> None:
        """Let a fault happen."""
        self.mode, self.fault = protocol.FAULT, code

    def _carry_out(self, data: bytes) -> None:
        answer = b""
        for operation, kind, first, count, values in protocol.subframes(data):
            if operation == protocol.READ:
                asked = range(first, first + count)
                answer += protocol.reply(kind, first, [self._register(at) for at in asked])
            elif first == protocol.MODE:
                self._change(int(values[0]))
            else:
                self._command |= {first + k: value for k, value in enumerate(values)}
                self._valid_ms = 1e3 * self._command.get(protocol.COMMAND + 7, math.inf)
        self._out += protocol.receive_line(DEVICE_ID, answer)

    def _change(self, mode: int) -> None:
        if mode == protocol.STOPPED:
            self.mode, self.fault = protocol.STOPPED, 0
            self._command = {}
        elif self.mode == protocol.STOPPED and mode == protocol.POSITION_MODE:
            self.mode, self._prepares_ms = _MEASURED, PREPARES_MS

    def _register(self, number: int) -> float:
        turn = 2 * math.pi
        state = State(
            self.mode, self._angle_rad / turn, self._speed_rad_s / turn, self.torque_n_m,
            self.torque_n_m / _TORQUE_CONSTANT_N_M_A, 48, 29, self.fault,
        )  # fmt: skip
        values = protocol.registers(protocol.encode_state(state))
        values |= {protocol.MODEL: 0x0700, protocol.MODEL + 1: 0x010D}
        values |= {protocol.SERIAL + k: 0x11111111 * (k + 1) for k in range(3)}
        return values.get(number, 0.0)


def open_fake(faults: Faults) -> Device:
    """Open the driver on a fake controller behind a cable with faults."""
    line = SimulatedTransport(MoteusFake(), "sim://moteus")
    return Moteus(FaultyTransport(line, faults))
