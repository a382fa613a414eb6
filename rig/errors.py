"""Errors of the application, and the exit code of every error of every room.

Exit codes: 0 done, 1 the result is bad (a check failed), 2 usage or configuration, 3 device or
link, 4 safety trip, 5 data damaged or unreadable, 70 a bug in rig, 130 interrupted.
"""

from enum import IntEnum

from calibration.errors import CalibrationError
from drivers.errors import DriverError
from estimation.errors import EstimationError, ExplainedError, NeedsExtraError
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


class MissingExtraError(NeedsExtraError, UsageError):
    """A library that a command needs is not installed."""


class DataError(RigError):
    """A file is damaged, truncated or not what it claims to be."""

    exit_code = ExitCode.DATA


class SafetyTripError(RigError):
    """A limit was crossed and the rig was brought to its safe state."""

    exit_code = ExitCode.SAFETY


PAGE = "docs/troubleshooting.md"
"""The page of symptoms, in the source tree and on the documentation site."""

A_BUG = "a-fault-in-rig-itself"
"""Section for an error that nobody raised on purpose."""

KNOWN: dict[str, tuple[str, ExitCode]] = {
    "drivers.DisarmUnconfirmedError": ("the-rig-stops", ExitCode.DEVICE),
    "drivers.DriveFaultError": ("the-rig-stops", ExitCode.DEVICE),
    "drivers.DriverError": ("the-rig-does-not-answer", ExitCode.DEVICE),
    "calibration.UnfitCalibrationError": ("a-calibration-must-not-be-used", ExitCode.DATA),
    "calibration.NoRecordError": ("a-calibration-must-not-be-used", ExitCode.USAGE),
    "calibration.StoreError": ("a-calibration-must-not-be-used", ExitCode.DATA),
    "calibration.UnknownNameError": ("a-command-is-refused", ExitCode.USAGE),
    "calibration.CalibrationError": ("a-calibration-is-refused", ExitCode.DATA),
    "estimation.OutputError": ("an-output-is-refused", ExitCode.USAGE),
    "estimation.PlantFileError": ("a-command-is-refused", ExitCode.USAGE),
    "estimation.PlantError": ("a-command-is-refused", ExitCode.USAGE),
    "estimation.UnknownNameError": ("a-command-is-refused", ExitCode.USAGE),
    "estimation.EstimationError": ("recordings-or-a-model-do-not-fit", ExitCode.DATA),
    "rig.SafetyTripError": ("the-rig-stops", ExitCode.SAFETY),
    "rig.DataError": ("a-log-is-refused", ExitCode.DATA),
    "rig.UsageError": ("a-command-is-refused", ExitCode.USAGE),
    "rig.RigError": ("the-rig-does-not-answer", ExitCode.FAILED),
}
"""Room and class of an error to the section of the page and the exit code.

The nearest base of a class counts; an error of the application states its own exit code.
"""

KNOWN_ERRORS = (RigError, OutputError, EstimationError, CalibrationError, DriverError)


def _known(kind: type[Exception]) -> tuple[str, ExitCode]:
    names = (f"{base.__module__.partition('.')[0]}.{base.__name__}" for base in kind.__mro__)
    return next((KNOWN[name] for name in names if name in KNOWN), (A_BUG, ExitCode.BUG))


def anchor_of(kind: type[Exception]) -> str:
    """Return the section of the troubleshooting page for a kind of error."""
    return _known(kind)[0]


def exit_code_of(error: Exception) -> ExitCode:
    """Return the documented exit code of an error raised on purpose."""
    return error.exit_code if isinstance(error, RigError) else _known(type(error))[1]
