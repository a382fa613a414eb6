"""Errors of the application, and the exit code of every error of every room.

Exit codes: 0 done, 1 the result is bad (a check failed), 2 usage or configuration, 3 device or
link, 4 safety trip, 5 data damaged or unreadable, 70 a bug in rig, 130 interrupted.
"""

from enum import IntEnum

from calibration.errors import CalibrationError
from calibration.errors import UnknownNameError as NoSuchRecord
from drivers.errors import DriverError
from estimation.errors import EstimationError, ExplainedError
from estimation.errors import UnknownNameError as NoSuchModel
from estimation.files import OutputError


class ExitCode(IntEnum):
    """Exit codes of the command line."""

    OK = 0
    FAILED = 1
    USAGE = 2
    DEVICE = 3
    SAFETY = 4
    DATA = 5
    BUG = 70
    INTERRUPTED = 130
    UNREAD = 141


class RigError(ExplainedError):
    """Base of every error the application raises on purpose."""

    exit_code = ExitCode.FAILED


class UsageError(RigError):
    """The command line or the configuration asks for something that cannot be."""

    exit_code = ExitCode.USAGE


class MissingExtraError(UsageError):
    """A library that a command needs is not installed.

    Attributes:
        extra: The project's extra that holds it, a key of `optional-dependencies`.
    """

    def __init__(self, what: str, why: str, extra: str) -> None:
        self.extra = extra
        super().__init__(what, why, f"Install the project's extra {extra!r}.")


class DataError(RigError):
    """A file is damaged, truncated or not what it claims to be."""

    exit_code = ExitCode.DATA


class SafetyTripError(RigError):
    """A limit was crossed and the rig was brought to its safe state."""

    exit_code = ExitCode.SAFETY


ROOM_EXIT_CODES: dict[type[Exception], ExitCode] = {
    OutputError: ExitCode.USAGE,
    NoSuchModel: ExitCode.USAGE,
    NoSuchRecord: ExitCode.USAGE,
    EstimationError: ExitCode.DATA,
    CalibrationError: ExitCode.DATA,
    DriverError: ExitCode.DEVICE,
}
"""Exit code of each other room's errors; the first class that fits counts."""

PAGE = "docs/troubleshooting.md"
"""The page of symptoms, in the source tree and on the documentation site."""

ANCHORS: dict[str, str] = {
    "rig.SafetyTripError": "the-rig-stops",
    "drivers.DisarmUnconfirmedError": "the-rig-stops",
    "drivers.DriveFaultError": "the-rig-stops",
    "drivers.DriverError": "the-rig-does-not-answer",
    "calibration.UnfitCalibrationError": "a-calibration-must-not-be-used",
    "calibration.StoreError": "a-calibration-must-not-be-used",
    "calibration.UnknownNameError": "a-command-is-refused",
    "calibration.CalibrationError": "a-calibration-is-refused",
    "estimation.OutputError": "an-output-is-refused",
    "estimation.UnknownNameError": "a-command-is-refused",
    "estimation.EstimationError": "recordings-or-a-model-do-not-fit",
    "rig.DataError": "a-log-is-refused",
    "rig.UsageError": "a-command-is-refused",
    "rig.RigError": "the-rig-does-not-answer",
}
"""Room and class of an error to the section of the page; the nearest base of a class counts."""

A_BUG = "a-fault-in-rig-itself"
"""Section for an error that nobody raised on purpose."""


def anchor_of(kind: type[Exception]) -> str:
    """Return the section of the troubleshooting page for a kind of error."""
    names = (f"{base.__module__.partition('.')[0]}.{base.__name__}" for base in kind.__mro__)
    return next((ANCHORS[name] for name in names if name in ANCHORS), A_BUG)


KNOWN_ERRORS: tuple[type[Exception], ...] = (RigError, *ROOM_EXIT_CODES)


def exit_code_of(error: Exception) -> ExitCode:
    """Return the documented exit code of an error raised on purpose."""
    if isinstance(error, RigError):
        return error.exit_code
    for base, code in ROOM_EXIT_CODES.items():
        if isinstance(error, base):
            return code
    return ExitCode.BUG
