"""Errors of the `calibration` room: what a calibration refuses."""


class CalibrationError(Exception):
    """Base of every error this room raises on purpose.

    Attributes:
        what: What happened, in one sentence.
        why: The cause as far as it is known; may be empty.
        fix: Action or next command; may be empty.
    """

    def __init__(self, what: str, why: str = "", fix: str = "") -> None:
        self.what = what
        self.why = why
        self.fix = fix
        super().__init__(" ".join(part for part in (what, why, fix) if part))


class UnknownNameError(CalibrationError):
    """What was named does not exist: a slip of whoever typed it."""
