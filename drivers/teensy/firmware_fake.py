"""The real firmware core as a fake: the library `make -C firmware` builds, in virtual time."""

import ctypes
import weakref
from pathlib import Path
from typing import Protocol

from drivers.errors import DriverError
from drivers.teensy.profile import Profile
from drivers.teensy.reference import REFERENCE

_LIBRARY = Path(__file__).parents[2] / "firmware" / "build" / "librig_firmware.so"
_TRANSMIT_SIZE = 65536


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
        ...


class FirmwareMissingError(DriverError):
    """The firmware library is not built."""


def firmware_library() -> Path | None:
    """Return the firmware library's path, or None where it is not built."""
    return _LIBRARY if _LIBRARY.is_file() else None


class FirmwareBoard:
    """The firmware core on a bench, with the interface of `drivers.transport.simulated.Board`.

    Args:
        bench: The physics.
        serial: Serial number the board gives.
        start_tick_us: Device clock at the first tick.
        library: The shared library; the built one when None.
        profile: Samples and motors of the board.

    Raises:
        FirmwareMissingError: The library is missing.
    """

    def __init__(
        self,
        bench: FirmwareBench,
        serial: str = "SIM-0001",
        start_tick_us: int = 0,
        library: Path | None = None,
        profile: Profile = REFERENCE,
    ) -> None:
        path = library or firmware_library()
        if path is None or not path.is_file():
            raise FirmwareMissingError(
                f"There is no firmware library at {path or _LIBRARY}.",
                "It has not been built, or this is an installation without the firmware's source.",
                "Run: make -C firmware (needs g++), or use the Python fake.",
            )
        self._bench = bench
        self._next_tick_us = start_tick_us
        self._tick_us = profile.tick_us
        self._functions = _load(path)
        self._handle = self._functions.rig_board_create(profile.name.encode(), serial.encode())
        if not self._handle:
            raise MemoryError("no memory for a firmware board")
        self._release = weakref.finalize(self, self._functions.rig_board_destroy, self._handle)
        self._tick_address = ctypes.cast(self._functions.rig_board_tick, ctypes.c_void_p).value or 0
        self._out = ctypes.create_string_buffer(_TRANSMIT_SIZE)

    @property
    def build_hash(self) -> int:
        """CRC-32 of the sources the core was built from."""
        return int(self._functions.rig_board_build_hash())

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


def _load(path: Path) -> ctypes.CDLL:
    """Load the library and declare its functions."""
    functions = ctypes.CDLL(str(path))
    functions.rig_board_create.argtypes = [ctypes.c_char_p, ctypes.c_char_p]
    functions.rig_board_create.restype = ctypes.c_void_p
    functions.rig_board_destroy.argtypes = [ctypes.c_void_p]
    functions.rig_board_destroy.restype = None
    functions.rig_board_receive.argtypes = [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_size_t]
    functions.rig_board_receive.restype = None
    functions.rig_board_build_hash.argtypes = []
    functions.rig_board_build_hash.restype = ctypes.c_uint32
    functions.rig_board_transmit.argtypes = [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_size_t]
    functions.rig_board_transmit.restype = ctypes.c_size_t
    return functions
