"""The compiled firmware core in this computer: the library that `make -C firmware` builds.

The board's logic and its guards exist once, in C++; whatever runs them on the host calls them here.
"""

import ctypes
import weakref
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from drivers.errors import DriverError
from drivers.teensy.profile import ArmLimits, Profile
from drivers.teensy.protocol import SESSION_DTYPE
from drivers.teensy.reference import REFERENCE

_LIBRARY = Path(__file__).parents[2] / "firmware" / "build" / "librig_firmware.so"
_TRANSMIT_SIZE = 65536
TICK = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_uint32, ctypes.c_void_p, ctypes.c_void_p)
"""The function that a bench calls; see `FirmwareBench.advance_with_board`."""


class FirmwareBench(Protocol):
    """Physics that calls a board itself, once a tick."""

    def advance_with_board(
        self, ticks: int, tick_address: int, board_address: int, tick_us: int
    ) -> None:
        """Run ticks with a board in the loop.

        Each tick: sample the inputs, call the board, move the physics a tick with what it gave.

        Args:
            ticks: Number of ticks.
            tick_address: Address of `void tick(void *board, uint32_t tick_us,
                const int32_t *inputs, int32_t *outputs)`. On the reference rig inputs are motor,
                spindle, jaw, proximal, distal, current and fsr counts, outputs command_e4 and
                load_ma; on the grasper three motor, three current and three force counts, and
                three command_e4.
            board_address: First argument of that function.
            tick_us: Device clock at the first tick; a period more each tick, modulo 2^32.
        """


class FirmwareMissingError(DriverError):
    """The firmware library is not built."""


def firmware_library() -> Path | None:
    """Return the firmware library's path, or None where it is not built."""
    return _LIBRARY if _LIBRARY.is_file() else None


@dataclass(frozen=True, slots=True)
class BoardStart:
    """How a board was started: its serial number, first tick and number of this start.

    Where it is simulated its encoder counts have their zeros and its motors are cold; a real board
    is started with neither.
    """

    serial: str = "SIM-0001"
    tick_us: int = 0
    boot: int = 1
    simulated: bool = True


class FirmwareBoard:
    """The firmware core on a bench, with the interface of `drivers.transport.simulated.Board`.

    Args:
        library: The shared library; the built one when None.
        own: Widest gains and limits the board takes, as wiring*.hpp gives them to a real one; any
            when None.

    Raises:
        FirmwareMissingError: The library is missing.
    """

    def __init__(
        self,
        bench: FirmwareBench,
        start: BoardStart = BoardStart(),
        library: Path | None = None,
        profile: Profile = REFERENCE,
        own: tuple[Sequence[Any], ArmLimits] | None = None,
    ) -> None:
        self._bench = bench
        self._next_tick_us = start.tick_us
        self._tick_us = profile.tick_us
        self._functions = _library(library)
        self._handle = self._functions.rig_board_create(
            profile.name.encode(), start.serial.encode()
        )
        if not self._handle:
            raise MemoryError("no memory for a firmware board")
        self._functions.rig_board_booted(self._handle, start.boot, start.simulated)
        if own is not None:
            taken = self._functions.rig_board_limit(self._handle, settings_bytes(profile, *own))
            if not taken:
                raise DriverError("The board's own limits are not valid.")
        self._release = weakref.finalize(self, self._functions.rig_board_destroy, self._handle)
        self._tick_address = ctypes.cast(self._functions.rig_board_tick, ctypes.c_void_p).value or 0
        self._out = ctypes.create_string_buffer(_TRANSMIT_SIZE)

    @property
    def build_hash(self) -> int:
        """CRC-32 of the sources the core was built from."""
        return int(self._functions.rig_board_build_hash())

    @property
    def in_force(self) -> bool:
        """Whether the motors are, or may any moment be, given current."""
        return bool(self._functions.rig_board_in_force(self._handle))

    @property
    def trip(self) -> int:
        """Code of what it has tripped over, 0 for nothing."""
        return int(self._functions.rig_board_trip(self._handle))

    def restore_trip(self, code: int) -> None:
        """Take over a trip from before this start; it is to be cleared here, too."""
        self._functions.rig_board_restore(self._handle, code)

    def assume_hot(self) -> None:
        """Take the motors for as hot as they may be, where nothing is known of the time before."""
        self._functions.rig_board_assume_hot(self._handle)

    def set_clock(self, tick_us: int) -> None:
        """Set the board's clock of the next tick, where ticks are not regular."""
        self._next_tick_us = tick_us % 2**32

    def skip(self, ticks: int) -> None:
        """Let ticks pass without running them: samples are lost, setpoints are played."""
        self._functions.rig_board_skip(self._handle, ticks)
        self._next_tick_us = (self._next_tick_us + ticks * self._tick_us) % 2**32

    def stop(self, pressed: bool) -> None:
        """Press or release the emergency stop that is wired to the board."""
        self._functions.rig_board_stop(self._handle, pressed)

    def index(self) -> None:
        """Let the index of the spindle's encoder come with the next tick."""
        self._functions.rig_board_index(self._handle)

    def receive(self, data: bytes) -> None:
        """Take bytes from the host and carry out the commands they complete."""
        self._functions.rig_board_receive(self._handle, data, len(data))

    def advance(self, ticks: int) -> None:
        """Let that many of the profile's ticks pass."""
        self._bench.advance_with_board(ticks, self._tick_address, self._handle, self._next_tick_us)
        self._next_tick_us = (self._next_tick_us + ticks * self._tick_us) % 2**32

    def transmit(self) -> bytes:
        """Give the bytes that wait for the host."""
        size = self._functions.rig_board_transmit(self._handle, self._out, _TRANSMIT_SIZE)
        return ctypes.string_at(self._out, size)


class CoreGuard:
    """The guards of an armed board alone, to hold its limits against samples as they arrive.

    Raises:
        FirmwareMissingError: The library is missing.
    """

    def __init__(
        self, profile: Profile, gains: Sequence[Any], limits: ArmLimits, library: Path | None = None
    ) -> None:
        self._functions = _library(library)
        settings = settings_bytes(profile, gains, limits)
        self._handle = self._functions.rig_guard_create(profile.name.encode(), settings)
        if not self._handle:
            raise MemoryError("no memory for a guard")
        self._release = weakref.finalize(self, self._functions.rig_guard_destroy, self._handle)

    def first_crossing(
        self, rows: NDArray[np.int32], ticks: NDArray[np.float64]
    ) -> tuple[int, int, int, int, int, int]:
        """Hold the limits against further samples.

        Args:
            rows: Inputs in the profile's order, counts, shape (n, inputs).
            ticks: Ticks between each and the one before it, more where samples were lost or late.

        Returns:
            Row, code, channel, value, limit and lateness, us, of the first crossing; row n and code
            0 when there is none.
        """
        inputs = np.zeros((len(rows), _MOST_INPUTS), np.int32)
        inputs[:, : rows.shape[1]] = rows
        apart = np.maximum(1, np.round(ticks)).astype(np.int64)
        crossing = np.zeros(5, np.int64)
        row = self._functions.rig_guard_check(
            self._handle,
            inputs.ctypes.data,
            _MOST_INPUTS,
            apart.ctypes.data,
            len(rows),
            crossing.ctypes.data,
        )
        code, channel, value, limit, late_us = crossing.tolist() if row < len(rows) else (0,) * 5
        return row, code, channel, value, limit, late_us


_MOST_INPUTS = 9
"""Of any profile."""


def settings_bytes(profile: Profile, gains: Sequence[Any], limits: ArmLimits) -> bytes:
    """Return gains and limits as an arm command carries them behind its session."""
    rows = np.atleast_2d(np.asarray(gains, np.float64))
    return profile.encode_arm(0, rows, limits, 0)[SESSION_DTYPE.itemsize :]


def _library(path: Path | None) -> ctypes.CDLL:
    path = path or firmware_library()
    if path is None or not path.is_file():
        raise FirmwareMissingError(
            f"There is no firmware library at {path or _LIBRARY}.",
            "It has not been built, or this is an installation without the firmware's source.",
            "Run: make -C firmware (needs g++).",
        )
    try:
        return _load(path, path.stat().st_mtime_ns)
    except (AttributeError, OSError) as error:
        raise FirmwareMissingError(
            f"The firmware library {path} does not fit this program.",
            f"It is a build of other sources: {error}.",
            "Run: make -C firmware (needs g++).",
        ) from error


@cache
def _load(path: Path, built_ns: int) -> ctypes.CDLL:
    functions = ctypes.CDLL(str(path))
    pointer, text, size = ctypes.c_void_p, ctypes.c_char_p, ctypes.c_size_t
    word, number = ctypes.c_uint32, ctypes.c_int32
    for name, result, arguments in (
        ("rig_board_create", pointer, (text, text)),
        ("rig_board_booted", None, (pointer, word, number)),
        ("rig_board_assume_hot", None, (pointer,)),
        ("rig_board_limit", number, (pointer, text)),
        ("rig_board_stop", None, (pointer, number)),
        ("rig_board_index", None, (pointer,)),
        ("rig_board_in_force", number, (pointer,)),
        ("rig_board_trip", number, (pointer,)),
        ("rig_board_restore", None, (pointer, number)),
        ("rig_board_skip", None, (pointer, word)),
        ("rig_board_destroy", None, (pointer,)),
        ("rig_board_receive", None, (pointer, text, size)),
        ("rig_board_build_hash", word, ()),
        ("rig_board_transmit", size, (pointer, text, size)),
        ("rig_guard_create", pointer, (text, text)),
        ("rig_guard_destroy", None, (pointer,)),
        ("rig_guard_check", size, (pointer, pointer, size, pointer, size, pointer)),
    ):
        function = getattr(functions, name)
        function.restype, function.argtypes = result, arguments
    return functions
