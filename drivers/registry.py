"""The installed drivers: objects in the entry point group `rig.drivers`, ours and third parties'.

A driver's fake is a function in the group `rig.driver_fakes` under the same name; only tests and
demonstrations load it.
"""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from importlib.metadata import EntryPoint, entry_points
from typing import Annotated, Any, TypeVar

from pydantic import Field

from drivers.device import Clocked, Device
from drivers.errors import DriverError, LinkError
from drivers.guarded import blaming, guarded
from drivers.transport import open_line
from drivers.transport.faulty import Faults

RateOption = Annotated[float, Field(gt=0, le=10_000, allow_inf_nan=False)]
"""Type of an option: samples a second."""
BaudOption = Annotated[int, Field(ge=1200, le=4_000_000)]
"""Type of an option: bit rate of a serial line."""

Way = TypeVar("Way", bound=Clocked)
Made = TypeVar("Made", bound=Device)

DRIVERS = "rig.drivers"
FAKES = "rig.driver_fakes"


class UnknownDriverError(DriverError):
    """No driver of that name is installed, or an installed one does not load."""


@dataclass(frozen=True, slots=True)
class CanUse:
    """What a device takes of a CAN bus.

    Attributes:
        identifiers: Every 11-bit identifier it sends or listens to, by the options it is opened
            with.
        bit_rate: Bit rate it comes with from the factory, bit/s.
    """

    identifiers: Callable[[Mapping[str, Any]], frozenset[int]]
    bit_rate: int


@dataclass(frozen=True, slots=True)
class Driver:
    """A driver as it is registered.

    Attributes:
        name: Short name, as written in a configuration.
        open: Opens the device by URL; its keyword arguments, all with defaults, are its options.
            A configuration is validated with their annotations, including pydantic's ranges. It
            raises `LinkError` where the way cannot be opened, or the options are no device's.
        can: Resources of the device on a CAN bus; None where it is not on one.
    """

    name: str
    description: str
    open: Callable[..., Device]
    can: CanUse | None = None

    @property
    def options(self) -> dict[str, Any]:
        """The options of `open` and their defaults."""
        parameters = list(inspect.signature(self.open).parameters.values())[1:]
        return {parameter.name: parameter.default for parameter in parameters}


def made(way: Way, make: Callable[[Way], Made], title: str) -> Made:
    """Return a device on an open way, which is closed where the device cannot be made.

    Raises:
        LinkError: `make` raised `ValueError`: the options are no such device's.
    """
    try:
        return make(way)
    except BaseException as error:
        way.close()
        if isinstance(error, ValueError):
            raise LinkError(f"No {title} can be used so: {error}.") from error
        raise


def opener(
    make: Callable[..., Made],
    title: str,
    open_way: Callable[..., Clocked] = open_line,
    baud_rate: int | None = None,
) -> Callable[..., Made]:
    """Return the function that opens a device by URL; its options are the device's own.

    `make` makes the device on an open way: its class, which annotates the options. The baud rate
    is of a serial line, which is a further option then; None for another way.
    """
    options = list(inspect.signature(make).parameters.values())
    options[0] = inspect.Parameter("url", inspect.Parameter.POSITIONAL_OR_KEYWORD, annotation=str)
    if baud_rate is not None:
        place = inspect.Parameter.KEYWORD_ONLY
        options.append(
            inspect.Parameter("baud_rate", place, default=baud_rate, annotation=BaudOption)
        )

    def open_it(url: str, **given: Any) -> Made:
        line = {} if baud_rate is None else {"baud_rate": given.pop("baud_rate", baud_rate)}
        return made(open_way(url, **line), lambda way: make(way, **given), title)

    open_it.__signature__ = inspect.Signature(options)  # type: ignore[attr-defined]
    open_it.__wrapped__ = make  # type: ignore[attr-defined]
    return open_it


OpenFake = Callable[[Faults], Device]
"""Opens a driver on its fake; the given faults strike between the two."""


def driver(name: str) -> Driver:
    """Return the driver of a name; no other is loaded.

    Raises:
        UnknownDriverError: None is installed, it does not load, or it is not a driver.
    """
    return _driver_of(_entry(name))


def _entry(name: str) -> EntryPoint:
    every = entry_points(group=DRIVERS)
    if name not in every.names:
        known = ", ".join(sorted(every.names))
        raise UnknownDriverError(f"There is no driver {name!r}.", f"Installed: {known}.")
    return every[name]


def _opened(entry: EntryPoint, open_it: Callable[[], Device]) -> Device:
    """Open a device; the errors of a driver that is not of this room name it."""
    if entry.module.partition(".")[0] == __name__.partition(".")[0]:
        return open_it()
    title = f"The driver {entry.name} of {_package(entry)}"
    with blaming(title):
        device = open_it()
    return guarded(device, title)


def drivers() -> dict[str, Driver]:
    """Return every installed driver that loads, by name; the others are in `broken_drivers`."""
    return {name: one for name, one in _every().items() if isinstance(one, Driver)}


def broken_drivers() -> dict[str, UnknownDriverError]:
    """Return the error of every installed driver that does not load, by name."""
    return {name: one for name, one in _every().items() if isinstance(one, UnknownDriverError)}


def _every() -> dict[str, Driver | UnknownDriverError]:
    found: dict[str, Driver | UnknownDriverError] = {}
    for entry in sorted(entry_points(group=DRIVERS)):
        try:
            found[entry.name] = _driver_of(entry)
        except UnknownDriverError as error:
            found[entry.name] = error
    return found


def _driver_of(entry: EntryPoint) -> Driver:
    loaded = _load(entry)
    if not isinstance(loaded, Driver) or loaded.name != entry.name:
        raise UnknownDriverError(
            f"{entry.value} of {_package(entry)} is not the driver {entry.name!r}.",
            f"Expected a drivers.registry.Driver of the name {entry.name!r}.",
            f"Install {_package(entry)} again, or remove it.",
        )
    return loaded


def fakes() -> dict[str, OpenFake]:
    """Return the function that opens each driver's fake, by the driver's name.

    A fake is loaded when it is opened, as it may need a library that another does not; opening one
    that does not load raises `UnknownDriverError`.
    """
    return {entry.name: partial(_open_fake, entry) for entry in sorted(entry_points(group=FAKES))}


def open_fake(name: str) -> Device:
    """Open a driver on its fake (`UnknownDriverError`: it has none)."""
    known = fakes()
    if name not in known:
        raise UnknownDriverError(
            f"The driver {name!r} has no fake.",
            f"Fakes are installed for: {', '.join(known)}.",
            "Write the url of the device in place of sim://.",
        )
    return known[name](Faults())


def _open_fake(entry: EntryPoint, faults: Faults) -> Device:
    open_it = _load(entry)
    return _opened(entry, lambda: open_it(faults))


def open_device(name: str, url: str, **options: Any) -> Device:
    """Open a device by the name of its driver, which gives the options.

    Raises:
        UnknownDriverError: No driver has this name, or it does not load.
        DriverError: The driver has no such option.
        LinkError: The link cannot be opened.
    """
    entry = _entry(name)
    named = _driver_of(entry)
    strange = sorted(set(options) - set(named.options))
    if strange:
        raise DriverError(
            f"The driver {name} has no option {', '.join(strange)}.",
            f"Its options are: {', '.join(named.options) or 'none'}.",
        )
    return _opened(entry, lambda: named.open(url, **options))


def _load(entry: EntryPoint) -> Any:
    try:
        return entry.load()
    except Exception as error:  # a module of another package may raise anything
        raise UnknownDriverError(
            f"The driver {entry.name!r} of {_package(entry)} cannot be loaded: {error}.",
            f"Its entry point is {entry.value}.",
            f"Install {_package(entry)} again, or remove it.",
        ) from error


def _package(entry: EntryPoint) -> str:
    return entry.dist.name if entry.dist else entry.module
