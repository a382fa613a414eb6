"""CAN buses by python-can, opened by URL: `can:INTERFACE:CHANNEL[?option=value&...]`.

Frames are read by the caller itself: no reader thread could die unnoticed. What an
interface raises becomes an error of this room, with its own as the cause.

Not known here: whether a bus has a terminator, or another node to acknowledge frames. On a bus
without one the interface's transmit queue fills up, and sending times out.
"""

import errno
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from time import monotonic
from typing import Any
from urllib.parse import parse_qsl

import can

from drivers import errors
from drivers.transport.can_bus import MAX_DATA, CanBus, CanCounters, CanFrame
from drivers.transport.transport import HostLink

SEND_TIMEOUT_S = 0.1
_EXAMPLES = "can:socketcan:can0 or can:slcan:/dev/ttyACM0@115200?bitrate=1000000"
_BUS_OFF, _CONTROLLER = 0x40, 0x04
_RX_OVERFLOW = 0x01
"""Classes of error frames, and the controller's detail in byte 1, as in Linux's can/error.h."""
_ECHOES_KEPT = 256


def _yes(text: str) -> bool:
    if text.lower() not in ("true", "false"):
        raise ValueError(f"{text!r} is neither true nor false")
    return text.lower() == "true"


@dataclass(frozen=True, slots=True)
class _Interface:
    options: dict[str, Callable[[str], Any]]
    fixed: dict[str, Any]
    channel: Callable[[str], dict[str, Any]] = lambda text: {"channel": text}
    echoes: bool = False


_INTERFACES = {
    "socketcan": _Interface({}, {}),
    "slcan": _Interface({"bitrate": int, "listen_only": _yes, "sleep_after_open": float}, {}),
    "gs_usb": _Interface({"bitrate": int}, {}, lambda text: {"channel": text, "index": int(text)}),
    "udp_multicast": _Interface({"port": int, "hop_limit": int}, {"fd": False}, echoes=True),
    "virtual": _Interface({"rx_queue_size": int}, {}),
}


class PythonCanBus(HostLink):
    """A bus over an open python-can interface; own frames that it `echoes` are dropped once."""

    def __init__(self, url: str, bus: can.BusABC, echoes: bool = False) -> None:
        super().__init__(url)
        self._bus = bus
        self._own: deque[tuple[int, bytes]] | None = deque(maxlen=_ECHOES_KEPT) if echoes else None
        self.counters = CanCounters()

    def send(self, frame: CanFrame) -> None:
        """Send one frame."""
        self._require_link()
        message = can.Message(
            arbitration_id=frame.can_id, data=frame.data, is_extended_id=frame.extended
        )
        try:
            self._bus.send(message, timeout=SEND_TIMEOUT_S)
        except (can.CanTimeoutError, BlockingIOError) as error:
            raise self._stuck() from error
        except (can.CanError, OSError) as error:
            if getattr(error, "error_code", None) == errno.ENOBUFS:
                raise self._stuck() from error
            raise self._gone(error) from error
        if self._own is not None:
            self._own.append((frame.can_id, frame.data))

    def read(self, timeout_s: float) -> CanFrame | None:
        """Return the next data frame, waiting at most `timeout_s` for it.

        Raises:
            BusOffError: The controller has taken itself off the bus.
        """
        self._require_link()
        give_up_s = monotonic() + timeout_s
        while True:
            try:
                message = self._bus.recv(max(0.0, give_up_s - monotonic()))
            except (can.CanError, OSError, ValueError) as error:
                raise self._gone(error) from error
            if message is None:
                return None
            if message.is_error_frame:
                self._note_error(message)
            elif not (
                message.is_remote_frame or len(message.data) > MAX_DATA or self._is_echo(message)
            ):
                return CanFrame(message.arbitration_id, bytes(message.data), message.is_extended_id)

    def close(self) -> None:
        """Let go of the interface."""
        if self._closes():
            self._bus.shutdown()  # not every interface bears a second one

    def _is_echo(self, message: can.Message) -> bool:
        key = (message.arbitration_id, bytes(message.data))
        if self._own is None or key not in self._own:
            return False
        self._own.remove(key)
        return True

    def _note_error(self, message: can.Message) -> None:
        self.counters.error_frames += 1
        kind, data = message.arbitration_id, bytes(message.data)
        if kind & _CONTROLLER and len(data) > 1 and data[1] & _RX_OVERFLOW:
            self.counters.overruns += 1
        if kind & _BUS_OFF:
            raise self._lose(
                f"The CAN controller of {self.url} has taken itself off the bus.",
                "It could not get its frames through: a short, a missing terminator,"
                " swapped wires, or another bit rate.",
                "Check CAN_H, CAN_L, both 120 ohm terminators and the bit rates, then start again.",
                errors.BusOffError,
            )

    def _stuck(self) -> errors.LinkTimeoutError:
        return errors.LinkTimeoutError(
            f"{self.url} took no frame for {SEND_TIMEOUT_S:g} s.",
            "No other node acknowledges, or the bus is full.",
            "Check that a device is powered, and that both ends have one bit rate.",
        )

    def _gone(self, error: Exception) -> errors.LinkLostError:
        return self._lose(
            f"The CAN bus {self.url} is gone.",
            f"The interface was unplugged or taken down ({error}).",
            "Check the adapter and start again.",
        )


def open_can(url: str) -> CanBus:
    """Open the CAN bus a URL names.

    - `can:socketcan:can0`; its bit rate is set by `ip link`
    - `can:slcan:/dev/ttyACM0@115200?bitrate=1000000`
    - `can:gs_usb:0?bitrate=1000000`
    - `can:udp_multicast:239.74.163.2?port=43113`
    - `can:virtual:NAME`, within one process

    Raises:
        UnknownSchemeError: No such interface.
        PortNotFoundError: The bus does not exist.
        PortBusyError: Another program holds it.
        PortPermissionError: The user may not open it.
        LinkError: An option is unknown or has no such value, or python-can refuses.
    """
    name, channel, options = _split(url)
    interface = _INTERFACES[name]
    try:
        arguments = interface.channel(channel)
        arguments |= {key: interface.options[key](value) for key, value in options.items()}
    except ValueError as error:
        raise errors.LinkError(
            f"{url!r} cannot be read: {error}.", "", f"Write e.g. {_EXAMPLES}."
        ) from error
    if name in ("slcan", "gs_usb") and "bitrate" not in options:
        raise errors.LinkError(
            f"{url!r} names no bit rate.",
            "A wrong one disturbs everybody on the bus, so none is assumed.",
            f"Write {url}{'&' if options else '?'}bitrate=1000000, or the rate of your bus.",
        )
    try:
        bus = can.Bus(interface=name, **arguments, **interface.fixed)
    except (can.CanError, OSError, ValueError, ImportError) as error:
        raise _explain(url, name, channel, error) from error
    return PythonCanBus(url, bus, interface.echoes)


def _split(url: str) -> tuple[str, str, dict[str, str]]:
    rest, _, query = url.partition("?")
    scheme, _, named = rest.partition(":")
    name, _, channel = named.partition(":")
    if scheme.lower() != "can" or name not in _INTERFACES or not channel:
        raise errors.UnknownSchemeError(
            f"No CAN bus is opened by {url!r}.",
            f"The interface is one of {', '.join(_INTERFACES)}, followed by its channel.",
            f"Write e.g. {_EXAMPLES}.",
        )
    options = dict(parse_qsl(query, keep_blank_values=True))
    strange = sorted(set(options) - set(_INTERFACES[name].options))
    if strange:
        raise errors.LinkError(
            f"{name} has no option {', '.join(strange)}.",
            f"Its options are: {', '.join(_INTERFACES[name].options) or 'none'}.",
            "The bit rate of socketcan is set by: sudo ip link set can0 up type can bitrate N."
            if name == "socketcan"
            else "",
        )
    return name, channel, options


def _explain(url: str, name: str, channel: str, error: Exception) -> errors.LinkError:
    code = getattr(error, "errno", None) or getattr(error, "error_code", None)
    up = f"Run: sudo ip link set {channel} up type can bitrate N."
    if isinstance(error, (ImportError, can.CanInterfaceNotImplementedError)):
        return errors.MissingExtraError(f"{url} cannot be opened.", f"{error}.", "can")
    if code in (errno.ENODEV, errno.ENOENT, errno.ENXIO):
        fix = up if name == "socketcan" else "Is the adapter plugged in?"
        return errors.PortNotFoundError(f"There is no CAN bus {url}.", str(error), fix)
    if code in (errno.EACCES, errno.EPERM):
        return errors.PortPermissionError(
            f"You may not open {url}.", str(error), "Give your user access by a udev rule."
        )
    if code in (errno.EBUSY, errno.EAGAIN):
        return errors.PortBusyError(
            f"{url} is in use.", str(error), "Close the program that holds it."
        )
    if code == errno.EAFNOSUPPORT:
        return errors.LinkError(
            f"{url} cannot be opened.",
            "The kernel of this computer has no CAN support.",
            "Run: sudo modprobe can_raw; or use an slcan or gs_usb adapter.",
        )
    return errors.LinkError(
        f"{url} cannot be opened.", f"{error}.", up if name == "socketcan" else ""
    )
