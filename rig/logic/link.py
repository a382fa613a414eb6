"""The logger of a rig that has none: its logic in this computer, behind it a drive.

The drive handles its current and measures its position; guards, position loop, queue of setpoints
and watchdog are the logger board's, run here tick by tick, a tick a sample of the drive. To the
rest of the program it is a link to a logger like any other. What a board does better: a pause of
this computer is a pause of the position loop; the drive then keeps its last command until its own
watch on this computer ends it. The logic is the firmware's own core, compiled for this computer.

A tick runs at every read. The ticks of an EPOS4 in real time run in a separate process
(`rig.canopen.process`), so that nothing delays them.
"""

from collections import deque
from collections.abc import Mapping

import numpy as np

from drivers.device import Channel, Drive
from drivers.teensy.core import TICK, BoardStart, FirmwareBoard
from drivers.teensy.protocol import MISSING, TOP
from drivers.transport.simulated import Pace
from drivers.transport.transport import HostLink
from rig.logic.latch import TripLatch

READ_S = 0.02
"""Time of the ticks between two polls of the host; shorter than any watchdog of the board."""
ANSWER_S = 0.005
MOST_MISSED = 3
"""Samples on end without an answer after which the motor's position is missing."""
KEPT = 4096
"""Samples of the drive that are kept for a reader."""

MOTOR, SPINDLE, CURRENT = 0, 1, 5
"""Columns of the inputs of a reference rig's board; the others are 0."""


class DriveBench:
    """A started drive as `drivers.teensy.core.FirmwareBench`: inputs from it, commands to it.

    Motor and spindle are both the drive's position; quantities that it does not measure are 0.
    """

    def __init__(self, device: Drive) -> None:
        self._device = device
        self._position_count = 0
        self._current_ma = 0
        self._missed = 0
        self._powered = False
        self._lost = 0
        self.board: FirmwareBoard | None = None  # the logic whose state the power stage follows
        # tick, values and flags of the drive's newest samples
        self.samples: deque[tuple[int, Mapping[str, float], int]] = deque(maxlen=KEPT)

    def advance_with_board(
        self, ticks: int, tick_address: int, board_address: int, tick_us: int
    ) -> None:
        """Run one tick; see `drivers.teensy.core.FirmwareBench.advance_with_board`."""
        assert ticks == 1, "a drive gives one sample at a time"  # noqa: S101
        self._measure(tick_us)
        inputs, outputs = np.zeros(7, np.int32), np.zeros(2, np.int32)
        missing = self._missed >= MOST_MISSED
        inputs[[MOTOR, SPINDLE]] = MISSING if missing else self._position_count
        inputs[CURRENT] = self._current_ma
        TICK(tick_address)(board_address, tick_us, inputs.ctypes.data, outputs.ctypes.data)
        if self.board is None or not self.board.in_force:
            self.follow(False)
        elif self._powered:
            self._device.command(1e-4 * int(outputs[0]))

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

    def _measure(self, tick_us: int) -> None:
        """Wait for the next sample, and take it if there is one."""
        batch = self._device.read(ANSWER_S)
        while not len(batch) and batch.lost == self._lost:
            batch = self._device.read(ANSWER_S)
        self._lost = batch.lost
        if not len(batch):
            self._missed += 1
            return
        axis = self._device.axis
        values = {name: float(column[-1]) for name, column in batch.columns.items()}
        self._missed = 0
        self._position_count = round(max(-TOP, min(TOP, values[axis.position] / axis.step)))
        self._current_ma = round(1000 * values[axis.current])
        self.samples.append((tick_us, values, int(batch.flags[-1])))


class LogicLink(HostLink):
    """A link to the logic of a logger, with the interface of `drivers.transport.Transport`.

    Args:
        device: The drive; identified and started here, closed with this. Its rate is the ticks'.
        url: Where it is, for messages.
        late_s: How late a tick may be and still be run, as its drive's `late_s`.
        is_cold: Whether the motor is known to be cold, as a simulated one; a real one may be warm
            from the session before.
        pace: Simulated seconds a real second; None for as fast as possible.
        latch: Where a trip is kept from one process to the next; None to forget it.
    """

    def __init__(
        self,
        device: Drive,
        url: str,
        *,
        late_s: float = 0.0,
        is_cold: bool = True,
        pace: float | None = None,
        latch: TripLatch | None = None,
    ) -> None:
        super().__init__(url)
        self._device = device
        rate_hz = device.channels[0].rate_hz
        self._period_us = round(1e6 / rate_hz)
        self._ticks_a_read = max(1, round(READ_S * rate_hz))
        self._pace = Pace(pace)
        identity = device.identify()
        device.start()
        self.bench = DriveBench(device)
        self.bench.release()  # an earlier program may have left it energised
        serial = identity.serial or identity.model.split()[-1]
        self._board = FirmwareBoard(self.bench, BoardStart(f"{device.name.upper()}-{serial}"))
        self.bench.board = self._board
        if not is_cold:
            self._board.assume_hot()
        self._latch = latch
        self._kept_trip = latch.code if latch else 0
        self._board.restore_trip(self._kept_trip)
        self._began_s = device.now_s
        self._late = round(late_s * 1e6) // self._period_us
        self._ticks = 0
        self._newest_us = 0

    @property
    def channels(self) -> tuple[Channel, ...]:
        """What the drive measures besides position and current."""
        axis = self._device.axis
        known = (axis.position, axis.current)
        return tuple(c for c in self._device.channels if c.name not in known)

    @property
    def now_s(self) -> float:
        """The drive's clock, seconds."""
        return self._device.now_s

    def read(self, timeout_s: float) -> bytes:
        """Run ticks until there are samples or `timeout_s` has passed.

        Raises:
            DriverError: The drive has a fault, is silent, or its bus is gone.
        """
        self._require_link()
        give_up_s = self._device.now_s + timeout_s
        data = self._board.transmit()
        ticks = 0
        while timeout_s > 0 and ticks < self._ticks_a_read and self._device.now_s < give_up_s:
            self._tick()
            ticks += 1
            data += self._board.transmit()
        return data

    def write(self, data: bytes) -> None:
        """Hand bytes to the logic; the drive follows it before anything is acknowledged."""
        self._require_link()
        before = self._board.in_force
        self._board.receive(data)
        self._keep_trip()
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
        end_s = self._device.now_s + duration_s
        while self._device.now_s < end_s:
            self._tick()

    def close(self) -> None:
        """Disarm where the drive may be armed, and let go of the bus.

        Raises:
            DisarmUnconfirmedError: The bus is closed, but the drive's state is unknown.
        """
        if self._closes():
            self._device.close()

    def _tick(self) -> None:
        self._missed_while_busy()
        self._device.idle(self._device.wait_s)
        # each sample has the time it was really asked for, however late that was
        now_us = round(self._device.now_s * 1e6)
        self._newest_us = max(now_us, self._newest_us + 1)
        self._board.set_clock(self._newest_us)
        self._ticks += 1
        self._board.advance(1)
        self._keep_trip()
        self._pace.keep(self._device.now_s)

    def _keep_trip(self) -> None:
        """Keep a new trip, and forget one that was cleared."""
        trip = self._board.trip
        if trip != self._kept_trip and self._latch is not None:
            self._kept_trip = trip
            self._latch.keep(trip)

    def _missed_while_busy(self) -> None:
        """Number the ticks that are too late to be run; they are lost."""
        due = round((self._device.now_s - self._began_s) * 1e6) // self._period_us
        missed = due - self._late - self._ticks - 1
        if missed > 0:
            self._board.skip(missed)
            self._ticks += missed
