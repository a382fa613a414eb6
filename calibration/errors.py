"""Errors of the `calibration` room: what a calibration refuses."""

from estimation.errors import ExplainedError


class CalibrationError(ExplainedError):
    """Base of every error this room raises on purpose."""


class UnknownNameError(CalibrationError):
    """What was named does not exist: a slip of whoever typed it."""
