"""What each driver can say of each fault: the counters that rise, these and no others.

Where two faults have the same names the device's protocol does not distinguish them: bytes without
a number that are missing, changed or there twice are all a checksum that does not fit, and behind a
late byte of a stream every other byte waits, as in a stall. Each driver's README says so, too.
"""

from drivers.transport.faulty import Fault

EVIDENCE = {"frames", "discarded_bytes"}
"""Counters of what came and of what was thrown away: they name no fault."""

_DAMAGED = {"crc_errors"}
_DAMAGED_AND_MISSING = {"crc_errors", "gaps", "lost"}
_MISSING = {"gaps", "lost"}
_SILENT = {"stalls"}
_UNANSWERED = {"gaps", "lost", "timeouts"}
_ASKED_AGAIN = {"gaps", "lost", "timeouts", "retries"}

_UNNUMBERED_STREAM = {
    Fault.DROP: _DAMAGED,
    Fault.CORRUPT: _DAMAGED,
    Fault.DUPLICATE: _DAMAGED,
    Fault.DELAY: _SILENT,
    Fault.STALL: _SILENT,
}
_NUMBERED_STREAM = {
    Fault.DROP: _DAMAGED_AND_MISSING,
    Fault.CORRUPT: _DAMAGED_AND_MISSING,
    Fault.DUPLICATE: _DAMAGED_AND_MISSING,
    Fault.DELAY: _SILENT,
    Fault.STALL: _SILENT,
}

SAID = {
    "amt21": {
        Fault.DROP: _ASKED_AGAIN | _DAMAGED,
        Fault.CORRUPT: _ASKED_AGAIN | _DAMAGED,
        Fault.DUPLICATE: _ASKED_AGAIN | _DAMAGED,
        Fault.DELAY: _ASKED_AGAIN | _DAMAGED,
        Fault.STALL: _ASKED_AGAIN | _DAMAGED,
    },
    "ati-can": {
        Fault.DROP: _ASKED_AGAIN,
        Fault.CORRUPT: _ASKED_AGAIN,
        Fault.DUPLICATE: {"late"},
        Fault.DELAY: _ASKED_AGAIN | {"late"},
        Fault.STALL: _ASKED_AGAIN | {"late"},
    },
    "ati-net": {
        Fault.DROP: _MISSING,
        Fault.CORRUPT: _MISSING,
        Fault.DUPLICATE: {"duplicates"},
        Fault.DELAY: _MISSING | {"late"},
        Fault.STALL: _SILENT,
    },
    "ati-serial": _UNNUMBERED_STREAM,
    "dynamixel": {
        Fault.DROP: _ASKED_AGAIN | _DAMAGED,
        Fault.CORRUPT: _ASKED_AGAIN | _DAMAGED,
        Fault.DUPLICATE: _ASKED_AGAIN | _DAMAGED,
        Fault.DELAY: _ASKED_AGAIN,
        Fault.STALL: _ASKED_AGAIN,
    },
    "epos4": {
        Fault.DROP: _UNANSWERED,
        Fault.CORRUPT: _UNANSWERED,
        Fault.DUPLICATE: {"late"},
        Fault.DELAY: _UNANSWERED | {"late"},
        Fault.STALL: _UNANSWERED | {"late"},
    },
    "ft300": _UNNUMBERED_STREAM,
    "moteus": {
        Fault.DROP: _ASKED_AGAIN | _DAMAGED,
        Fault.CORRUPT: _ASKED_AGAIN | _DAMAGED,
        Fault.DUPLICATE: _ASKED_AGAIN | _DAMAGED,
        Fault.DELAY: _ASKED_AGAIN,
        Fault.STALL: _ASKED_AGAIN,
    },
    "qia128": _UNNUMBERED_STREAM,
    "teensy": _NUMBERED_STREAM,
    "teensy-master": _NUMBERED_STREAM,
    "usb520": {
        **_UNNUMBERED_STREAM,
        Fault.DROP: _DAMAGED | _SILENT,
        Fault.CORRUPT: _DAMAGED | _SILENT,
    },
}
