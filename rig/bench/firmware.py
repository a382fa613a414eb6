"""The firmware's sources, the board's build, and the tools that bring one to the other."""

import shutil
import subprocess
import sys
import zlib
from dataclasses import dataclass
from pathlib import Path

from drivers.errors import DriverError, ProtocolMismatchError
from drivers.teensy import protocol
from drivers.teensy.driver import TeensyLogger
from drivers.teensy.grasper import GRASPER
from drivers.teensy.reference import REFERENCE
from rig.bench.flashing import Board, board_to_flash
from rig.bench.logger import open_logger
from rig.configuration.config import Config
from rig.errors import RigError, UsageError
from rig.machines.choose import machine_of

SOURCES = Path(__file__).parents[2] / "firmware"
STDERR = 2
"""Stream for the output of tools: stdout is for results."""
BOARDS = ("teensy35", "teensy41", "teensy41-grasper")


class FirmwareToolError(RigError):
    """A compiler or an uploader failed."""


@dataclass(frozen=True, slots=True)
class Versions:
    """Which firmware is where."""

    program: str  # protocol of this program
    sources: str  # the build of the source tree, or a note that there is none
    board: str  # the board's identity, or the reason why it is unknown
    fits: bool  # whether program and board have the same protocol
    remarks: tuple[str, ...]  # remarks, with the next command


def source_hash() -> int | None:
    """Return the CRC-32 of the core's sources, None without a source tree.

    It is the one POSIX `cksum` gives, over the files in the order of their names.
    """
    files = sorted((SOURCES / "core").glob("*.hpp"))
    if not files:
        return None
    return posix_cksum(b"".join(file.read_bytes() for file in files))


def posix_cksum(data: bytes) -> int:
    """Return the checksum of POSIX `cksum`: CRC-32, high bit first, the length behind the data.

    zlib's CRC runs low bit first: bytes and result are reversed bit by bit.
    """
    size = len(data).to_bytes((len(data).bit_length() + 7) // 8, "little")
    crc = zlib.crc32((data + size).translate(_REVERSED), 0xFFFFFFFF)
    return int(f"{crc:032b}"[::-1], 2)


_REVERSED = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))


def compare(config: Config) -> Versions:
    """Read the board's firmware version and compare it with program and sources."""
    profile = machine_of(config).profile
    version = protocol.version_text(protocol.FIRMWARE_VERSION)
    program = f"{version}, {profile.name} protocol {profile.protocol_hash:08x}"
    sources = source_hash()
    told = "no source tree here" if sources is None else f"build {sources:08x}"
    try:
        with TeensyLogger(open_logger(config), profile) as logger:
            board = logger.identify()
    except ProtocolMismatchError as error:
        return Versions(program, told, f"{error.what} {error.why}", False, (f"fix: {error.fix}",))
    except DriverError as error:
        return Versions(program, told, f"{error.what}", False, (f"fix: {error.fix}",))
    remarks: tuple[str, ...] = ("Program and board have the same protocol.",)
    if sources is not None and board.build_hash and board.build_hash != sources:
        remarks += (
            "The board was built from other sources. To bring it up to date: rig firmware"
            " flash (the simulated rig: rig firmware build)",
        )
    if not board.build_hash:
        remarks += (
            "The board is the plain simulated one, or has no build. To compile: rig firmware build",
        )
    said = f"{board.serial}, {board.firmware_version}, protocol {board.protocol_hash:08x}"
    return Versions(program, told, f"{said}, build {board.build_hash:08x}", True, remarks)


def build() -> Path:
    """Build the library the simulated rig runs, and return its path.

    Raises:
        UsageError: The source tree, make or the compiler is missing.
        FirmwareToolError: The compiler fails.
    """
    _require_sources()
    _require("make", "apt-get install make g++")
    _run(["make", "-C", str(SOURCES)])
    return SOURCES / "build" / "librig_firmware.so"


def build_for(board: str) -> Path:
    """Build the firmware of a Teensy by PlatformIO, and return the folder of the result.

    Raises:
        UsageError: No such board, no source tree, or no PlatformIO.
        FirmwareToolError: It fails.
    """
    _platformio(board, [])
    return SOURCES / ".pio" / "build" / board


def flash(board: str, serial: str = "") -> Board:
    """Build for a Teensy and write it to the one that is plugged in; return which that was.

    `board` is the image; the serial number is that of the Teensy, any when it is empty.

    Raises:
        UsageError: No such image, no source tree, no PlatformIO, or not exactly one board.
        PortBusyError: Another program has the board.
        SafetyTripError: The board is armed.
        FirmwareToolError: It fails.
    """
    _require_platformio(board)
    profile = GRASPER if board.endswith("grasper") else REFERENCE
    found = board_to_flash(serial, profile)
    what = f"Flashing {board} to the board {found.serial} at {found.port}: {found.state}."
    sys.stderr.write(f"{what}\n")
    _platformio(board, ["--target", "upload"])
    return found


def _platformio(board: str, more: list[str]) -> None:
    _require_platformio(board)
    _run(["pio", "run", "--project-dir", str(SOURCES), "--environment", board, *more])


def _require_platformio(board: str) -> None:
    if board not in BOARDS:
        raise UsageError(f"The board {board!r} is not known.", fix=f"Choose {', '.join(BOARDS)}.")
    _require_sources()
    if not (SOURCES / "platformio.ini").is_file():
        raise UsageError("This source tree has no platformio.ini.", fix="Update the checkout.")
    _require("pio", "pip install platformio")


def _require_sources() -> None:
    if source_hash() is None:
        raise UsageError(
            "There are no firmware sources here.",
            f"{SOURCES} is not there: rig was installed without its repository.",
            "Run this in a checkout of the repository.",
        )


def _require(tool: str, fix: str) -> None:
    if shutil.which(tool) is None:
        raise UsageError(f"{tool} is not installed.", fix=f"Run: {fix}")


def _run(command: list[str]) -> None:
    done = subprocess.run(command, check=False, stdout=STDERR)  # noqa: S603
    if done.returncode:
        raise FirmwareToolError(
            f"{command[0]} failed with exit code {done.returncode}.",
            f"The command was: {' '.join(command)}",
            "Its messages stand above.",
        )
