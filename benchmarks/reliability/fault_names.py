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

_UNNUMBERED_STREAM = (_DAMAGED, _DAMAGED, _DAMAGED, _SILENT, _SILENT)
_NUMBERED_STREAM = (*3 * (_DAMAGED_AND_MISSING,), _SILENT, _SILENT)
_LATE = {"late"}
_CHECKED_ANSWER = (*3 * (_ASKED_AGAIN | _DAMAGED,), _ASKED_AGAIN, _ASKED_AGAIN)

_BY_FAULT = {
    "amt21": 5 * (_ASKED_AGAIN | _DAMAGED,),
    "ati-can": (_ASKED_AGAIN, _ASKED_AGAIN, _LATE, _ASKED_AGAIN | _LATE, _ASKED_AGAIN | _LATE),
    "ati-net": (_MISSING, _MISSING, {"duplicates"}, _MISSING | _LATE, _SILENT),
    "ati-serial": _UNNUMBERED_STREAM,
    "dynamixel": _CHECKED_ANSWER,
    "epos4": (_UNANSWERED, _UNANSWERED, _LATE, _UNANSWERED | _LATE, _UNANSWERED | _LATE),
    "ft300": _UNNUMBERED_STREAM,
    "moteus": _CHECKED_ANSWER,
    "qia128": _UNNUMBERED_STREAM,
    "teensy": _NUMBERED_STREAM,
    "teensy-master": _NUMBERED_STREAM,
    "usb520": (*2 * (_DAMAGED | _SILENT,), _DAMAGED, _SILENT, _SILENT),
}
"""By driver: what a frame that is missing, changed, twice there, late or stalled raises."""
_FAULTS = (Fault.DROP, Fault.CORRUPT, Fault.DUPLICATE, Fault.DELAY, Fault.STALL)

SAID = {driver: dict(zip(_FAULTS, said, strict=True)) for driver, said in _BY_FAULT.items()}
