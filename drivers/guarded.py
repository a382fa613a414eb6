"""A device whose driver is of another package: its errors and wrong samples name the driver."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from traceback import extract_tb
from typing import Any, TypeVar

import numpy as np

from drivers.device import Batch, Device, DeviceIdentity, Drive
from drivers.errors import DriverError

Answer = TypeVar("Answer")


class ForeignDriverError(DriverError):
    """A driver of another package has a fault."""


@contextmanager
def blaming(title: str) -> Iterator[None]:
    """Raise a fault of a driver as a `ForeignDriverError` that names it and its package."""
    try:
        yield
    except DriverError:
        raise
    except Exception as error:
        place = extract_tb(error.__traceback__)[-1]
        raise ForeignDriverError(
            f"{title} failed: {type(error).__name__}: {error}.",
            f"It was raised in {place.name}, {place.filename}, line {place.lineno}.",
            "Report it to those who made the package, or install another version of it.",
        ) from error


def guarded(device: Device, title: str) -> Device:
    """Return a device of another package's driver, with that driver named in its errors."""
    with blaming(title):
        return GuardedDrive(device, title) if isinstance(device, Drive) else Guarded(device, title)


def require(answer: object, kind: type[Answer], title: str, call: str) -> Answer:
    """Return the answer of a driver; `ForeignDriverError` unless it is of the kind stated."""
    if not isinstance(answer, kind):
        raise ForeignDriverError(
            f"{title} returned {type(answer).__name__} from {call}.",
            f"A drivers.device.{kind.__name__} is expected.",
        )
    return answer


def require_whole(batch: Batch, names: Iterable[str], title: str) -> None:
    """Refuse, by `ForeignDriverError`, a batch without a column or with one of another length."""
    whole = (len(batch),)
    columns: dict[str, Any] = {"sequence": batch.sequence, "flags": batch.flags}
    columns |= {name: batch.columns[name] for name in names if name in batch.columns}
    missing = [name for name in names if name not in columns]
    wrong = [f"{name} has {np.shape(c)}" for name, c in columns.items() if np.shape(c) != whole]
    if missing or wrong:
        what = f"no column {missing[0]}" if missing else f"a column of the wrong shape: {wrong[0]}"
        raise ForeignDriverError(
            f"{title} sent a batch with {what}.",
            f"Its channels are {', '.join(names)}; each has the shape {whole} of time_s.",
        )


def _call(name: str) -> Any:
    def pass_on(self: "Guarded", *arguments: Any) -> Any:
        with blaming(self._title):
            return getattr(self._device, name)(*arguments)

    return pass_on


def _value(name: str, made: Callable[[Any], Any] = lambda value: value) -> Any:
    def get(self: "Guarded") -> Any:
        with blaming(self._title):
            return made(getattr(self._device, name))

    return property(get)


class Guarded(Device):
    """See `guarded`; its members are those of `drivers.device.Device`."""

    def __init__(self, device: Any, title: str) -> None:
        self._device = device
        self._title = title

    def __getattr__(self, name: str) -> Any:
        """Return a member that this device has and others lack."""
        return getattr(self._device, name)

    name = _value("name", str)
    channels = _value("channels", tuple)
    counters = _value("counters", dict)
    start = _call("start")
    stop = _call("stop")
    close = _call("close")

    def identify(self) -> DeviceIdentity:
        """Ask who is there."""
        with blaming(self._title):
            return require(self._device.identify(), DeviceIdentity, self._title, "identify")

    def read(self, timeout_s: float) -> Batch:
        """Return the samples that have come."""
        with blaming(self._title):
            batch = require(self._device.read(timeout_s), Batch, self._title, "read")
            if len(batch):
                names = [channel.name for channel in self._device.channels]
                require_whole(batch, names, self._title)
            return batch


class GuardedDrive(Guarded, Drive):
    """A drive; see `guarded`."""

    axis = _value("axis")
    now_s = _value("now_s", float)
    wait_s = _value("wait_s", float)
    idle = _call("idle")
    arm = _call("arm")
    command = _call("command")
    disarm = _call("disarm")
