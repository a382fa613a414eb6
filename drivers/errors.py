"""Errors of the `drivers` room: what a device or its link refuses."""


class DriverError(Exception):
    """Base of every error this room raises on purpose.

    Attributes:
        what: What happened, in one sentence.
        why: The cause as far as it is known; may be empty.
        fix: What to do or to type next; may be empty.
    """

    def __init__(self, what: str, why: str = "", fix: str = "") -> None:
        self.what = what
        self.why = why
        self.fix = fix
        super().__init__(" ".join(part for part in (what, why, fix) if part))


class FrameError(DriverError):
    """Bytes between two delimiters are not a frame."""


class LinkError(DriverError):
    """Base of what can be wrong with the way to a device."""


class LinkLostError(LinkError):
    """The link was open and is gone: unplugged, closed at the other end, or taken away."""


class LinkTimeoutError(LinkError):
    """The device did not answer, or did not take bytes, in time."""


class BusOffError(LinkLostError):
    """A CAN controller has taken itself off the bus after too many errors."""


class PortNotFoundError(LinkError):
    """No such port, or no device with that USB identity."""


class PortBusyError(LinkError):
    """Another program holds the port."""


class PortPermissionError(LinkError):
    """The user may not open the port."""


class UnknownSchemeError(LinkError):
    """No transport is registered for the scheme of a URL."""


class ProtocolMismatchError(DriverError):
    """The board's firmware and this program speak different protocols."""


class CodedError(DriverError):
    """An error to which the device gives a number.

    Attributes:
        code: That number; 0 where it gave none.
    """

    def __init__(self, what: str, why: str = "", fix: str = "", code: int = 0) -> None:
        self.code = code
        super().__init__(what, why, fix)


class CommandRefusedError(CodedError):
    """The board understood a command and refused it; `code` is a `protocol.Result`."""


class DisarmUnconfirmedError(DriverError):
    """The board was commanded to disarm and has not confirmed it: its state is unknown."""


class MissingExtraError(LinkError):
    """A library that this room needs here is not installed.

    Attributes:
        extra: The project's extra that holds it, a key of `optional-dependencies`.
    """

    def __init__(self, what: str, why: str, extra: str) -> None:
        self.extra = extra
        super().__init__(what, why, f"Install the project's extra {extra!r}.")
