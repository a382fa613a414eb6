"""Why a board refuses a command, and what to do."""

from drivers.errors import CommandRefusedError, ProtocolMismatchError
from drivers.teensy import protocol
from drivers.teensy.grasper import GRASPER
from drivers.teensy.profile import Profile
from drivers.teensy.protocol import Identity, Kind, Result
from drivers.teensy.reference import REFERENCE

FLASH = "Run: rig firmware flash"
_REASONS: dict[int, tuple[str, str]] = {
    Result.UNKNOWN_KIND: ("The command is unknown to the board.", FLASH),
    Result.WRONG_SIZE: ("The command has the wrong size.", FLASH),
    Result.WRONG_VERSION: ("Its frame version differs.", FLASH),
    Result.BAD_VALUE: (
        "A value is not finite, out of its range, or beyond the limits it was armed with.",
        "Check gains, limits and setpoints.",
    ),
    Result.QUEUE_FULL: (
        f"Its queue holds {protocol.QUEUE_CAPACITY} setpoints and is full.",
        "Read samples, then queue on.",
    ),
    Result.NOT_REFERENCED: (
        "Its counts have no zeros: it was restarted, or a check of an encoder failed.",
        "Run: rig reference",
    ),
    Result.NOT_AT_REST: (
        "It is armed, or a shaft is turning.",
        "Disarm it, let go of the shafts and try again.",
    ),
    Result.NO_INDEX: (
        "No index of the spindle's encoder has come since it was started or last referenced.",
        "Turn the spindle through its index. If that does not help, check the index's wire.",
    ),
    Result.NOT_ARMED: (
        "It is not armed: it never was, was disarmed, or its watchdog or a limit tripped.",
        "Look at the status of its samples, then arm it.",
    ),
    Result.WRONG_SESSION: (
        "It was armed by another program, or by an earlier command of this one.",
        "Let only one program move the rig.",
    ),
    Result.OLD_SEQUENCE: (
        "A later command of this program has come before it.",
        "Look for a link that doubles or re-orders frames.",
    ),
    Result.TRIPPED: (
        "It tripped, or its emergency stop is pressed, and nobody has cleared that.",
        "Find the cause, then run: rig clear",
    ),
    Result.WRONG_TRIP: (
        "It has tripped over something else.",
        "Read its trip again, then clear that one.",
    ),
    Result.ALREADY_ARMED: ("It is armed already.", "Disarm it first: rig stop"),
    Result.TOO_HOT: (
        "More than half of the heat its motors may take is used up, or it was just started and"
        " the heat from before is not known.",
        "Wait; they cool while nothing moves.",
    ),
    Result.TOO_FAST: (
        "A setpoint asks for a motion that is too fast: it is farther from the one before it than"
        " the motor may turn in a tick.",
        "Let the trajectory begin where the shaft stands, or slow it down; [safety]"
        " motor_speed_rad_s is the limit.",
    ),
    Result.BEYOND_BOARD: (
        "A limit or a command is wider than those the board was built with (wiring*.hpp).",
        "Choose narrower limits. Wider ones need another build of the firmware.",
    ),
}


def refused(url: str, kind: Kind, result: int) -> CommandRefusedError:
    """Return the error of a command that the board at a URL refused."""
    why, fix = _REASONS.get(result, (f"Its reason has number {result}.", ""))
    what = f"The board at {url} refused {kind.name.lower()}."
    return CommandRefusedError(what, why, fix, result)


def other_layout(url: str, profile: Profile, why: str) -> ProtocolMismatchError:
    """Return the error of a board whose answer to the first question cannot be read."""
    return _mismatch(url, profile, "a protocol of another layout", why, FLASH)


def other_protocol(url: str, profile: Profile, identity: Identity) -> ProtocolMismatchError:
    """Return the error of a board that speaks another protocol than this program."""
    theirs, own = identity.protocol_hash, protocol.version_text(protocol.FIRMWARE_VERSION)
    named = [known.name for known in (REFERENCE, GRASPER) if theirs == known.protocol_hash]
    why = (
        f"The board {identity.serial} has firmware {identity.firmware_version},"
        f" this program goes with {own}."
    )
    what, fix = f"protocol {theirs:08x}", FLASH
    if named:
        what += f" ({named[0]})"
        fix = f'Write profile = "{named[0]}" into [logger], or {FLASH}'
    return _mismatch(url, profile, what, why, fix)


def _mismatch(url: str, profile: Profile, theirs: str, why: str, fix: str) -> ProtocolMismatchError:
    ours = f"protocol {profile.protocol_hash:08x} ({profile.name})"
    return ProtocolMismatchError(f"The board at {url} has {theirs}, this program {ours}.", why, fix)
