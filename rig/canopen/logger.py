"""The logger of a rig that has none: its logic in this computer, behind it a drive on CANopen.

The drive handles torque and position; guards, position loop, queue of setpoints and watchdog are
the logger board's, run here tick by tick, a tick a SYNC. To the rest of the program it is a link to
a logger like any other. What a board does better: a pause of this computer is a pause of the
position loop; the drive then keeps its last torque until its own watch on this computer's heartbeat
ends it. The logic is the firmware's own core, compiled for this computer.

In virtual time a tick runs at every read. In real time the ticks run in a separate
process (`rig.canopen.process`), so that nothing delays them.
"""

import ctypes

import numpy as np

from drivers.epos4.drive import Epos4
from drivers.errors import LinkLostError
from drivers.teensy.core import BoardStart, FirmwareBoard
from drivers.teensy.protocol import MISSING
from drivers.teensy.reference import TICK_US
from drivers.transport.can_bus import CanBus

SERIAL_PREFIX = "EPOS4-"
TICKS_A_READ = 20
"""Most ticks between polls of the host; shorter than any watchdog time of the board."""
ANSWER_S = 0.005
MOST_MISSED = 3
"""SYNCs on end without an answer after which the motor's position is missing."""


MOTOR, SPINDLE, CURRENT = 0, 1, 5
"""Columns of the inputs of a reference rig's board; the others are 0."""
_TICK = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_uint32, ctypes.c_void_p, ctypes.c_void_p)


class Epos4Bench:
    """The drive as `drivers.teensy.core.FirmwareBench`: inputs from it, torque to it.

    The spindle is the motor's encoder; current is computed from torque, 1 mA per count; quantities
    that the drive does not measure are 0.

    Args:
        device: The drive, started.
    """

    def __init__(self, device: Epos4) -> None:
        self._device = device
        self._rated_torque_n_m = device.ratings.rated_torque_n_m
        self._position_count = 0
        self._current_ma = 0
        self._missed = 0
        self._powered = False
        self._lost = 0
        self.board: FirmwareBoard | None = None
        """The logic whose state the power stage follows."""

    def advance_with_board(
        self, ticks: int, tick_address: int, board_address: int, tick_us: int
    ) -> None:
        """Run ticks, one a SYNC; see `drivers.teensy.core.FirmwareBench.advance_with_board`."""
        tick = _TICK(tick_address)
        inputs, outputs = np.zeros(7, np.int32), np.zeros(2, np.int32)
        for k in range(ticks):
            self._measure()
            missing = self._missed >= MOST_MISSED
            inputs[[MOTOR, SPINDLE]] = MISSING if missing else self._position_count
            inputs[CURRENT] = self._current_ma
            clock_us = (tick_us + TICK_US * k) % 2**32
            tick(board_address, clock_us, inputs.ctypes.data, outputs.ctypes.data)
            self._command(int(outputs[0]), self.board is not None and self.board.in_force)

    def follow(self, in_force: bool) -> None:
        """Switch the power stage on or off, and return when the drive has confirmed it.

        Raises:
            DriverError: It has not confirmed it.
        """
        if in_force and not self._powered:
            self._powered = True  # a drive that failed half-way is to be disarmed
            self._device.arm()
        elif not in_force and self._powered:
            self._device.disarm()
            self._powered = False

    def release(self) -> None:
        """Disarm whatever is believed, and read it back."""
        self._device.disarm()
        self._powered = False

    def _measure(self) -> None:
        """Wait for the next SYNC and take the drive's answer, if there is one."""
        batch = self._device.read(ANSWER_S)
        while not len(batch) and batch.lost == self._lost:
            batch = self._device.read(ANSWER_S)
        self._lost = batch.lost
        if len(batch):
            self._missed = 0
            self._position_count = int(batch.columns["position_count"][-1])
            self._current_ma = round(1000 * float(batch.columns["motor_current_a"][-1]))
        else:
            self._missed += 1

    def _command(self, command_e4: int, in_force: bool) -> None:
        if not in_force:
            self.follow(False)
        elif self._powered:
            self._device.set_torque(1e-4 * command_e4 * self._rated_torque_n_m)


class CanopenLogger:
    """A link to the logic of a logger, with the interface of `drivers.transport.Transport`.

    Args:
        device: The drive; identified and started here, closed with this.
        bus: The bus it is on, for its clock.
        late_s: How late a tick may be and still be run, as its drive's `late_s`.
        is_cold: Whether the motor is known to be cold, as a simulated one; a real one may be warm
            from the session before.
    """

    def __init__(
        self, device: Epos4, bus: CanBus, late_s: float = 0.0, is_cold: bool = True
    ) -> None:
        self._device = device
        self._bus = bus
        self._closed = False
        identity = device.identify()
        device.start()
        self.bench = Epos4Bench(device)
        self.bench.release()  # an earlier program may have left it in force
        self._board = FirmwareBoard(self.bench, BoardStart(f"{SERIAL_PREFIX}{identity.serial}"))
        self.bench.board = self._board
        if not is_cold:
            self._board.assume_hot()
        self._began_s = bus.now_s
        self._late = round(late_s * 1e6) // TICK_US
        self._ticks = 0
        self._newest_us = 0

    @property
    def url(self) -> str:
        """The bus's URL."""
        return self._bus.url

    @property
    def now_s(self) -> float:
        """The bus's clock, seconds."""
        return self._bus.now_s

    def read(self, timeout_s: float) -> bytes:
        """Run ticks until there are samples or `timeout_s` has passed.

        Raises:
            DriverError: The drive has a fault, is silent, or its bus is gone.
        """
        self._require_link()
        give_up_s = self._bus.now_s + timeout_s
        data = self._board.transmit()
        ticks = 0
        while timeout_s > 0 and ticks < TICKS_A_READ and self._bus.now_s < give_up_s:
            self._tick()
            ticks += 1
            data += self._board.transmit()
        return data

    def write(self, data: bytes) -> None:
        """Hand bytes to the logic; the drive follows it before anything is acknowledged."""
        self._require_link()
        before = self._board.in_force
        self._board.receive(data)
        after = self._board.in_force
        if after != before:
            self.bench.follow(after)
            self._missed_while_busy()

    def take(self) -> bytes:
        """Give the bytes that wait for the host."""
        return self._board.transmit()

    def run(self, duration_s: float) -> None:
        """Run the ticks that are due in this time.

        Raises:
            DriverError: The drive has a fault, is silent, or its bus is gone.
        """
        self._require_link()
        end_s = self._bus.now_s + duration_s
        while self._bus.now_s < end_s:
            self._tick()

    def close(self) -> None:
        """Disarm where the drive may be armed, and let go of the bus.

        Raises:
            DisarmUnconfirmedError: The bus is closed, but the drive's state is unknown.
        """
        if not self._closed:
            self._closed = True
            self._device.close()

    def _tick(self) -> None:
        self._missed_while_busy()
        self._device.idle(self._device.wait_s)
        # each sample has the time it was really asked for, however late that was
        now_us = round(self._bus.now_s * 1e6)
        self._newest_us = max(now_us, self._newest_us + 1)
        self._board.set_clock(self._newest_us)
        self._ticks += 1
        self._board.advance(1)

    def _missed_while_busy(self) -> None:
        """Number the ticks that are too late to be run; they are lost."""
        due = round((self._bus.now_s - self._began_s) * 1e6) // TICK_US
        missed = due - self._late - self._ticks - 1
        if missed > 0:
            self._board.skip(missed)
            self._ticks += missed

    def _require_link(self) -> None:
        if self._closed:
            raise LinkLostError(f"{self.url} is closed.")
