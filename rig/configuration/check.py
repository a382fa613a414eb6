"""Checks of a valid configuration: drivers, options, CAN buses."""

import inspect
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any
from urllib.parse import parse_qsl

from pydantic import ConfigDict, ValidationError, create_model

from calibration.linear import SHIPPED as SHIPPED_CALIBRATIONS
from drivers.registry import Driver, UnknownDriverError, driver, fakes
from estimation.errors import nearest
from rig.configuration.config import SHIPPED, Config, is_simulated
from rig.configuration.machine_settings import settings_of
from rig.configuration.sections import DeviceSection
from rig.configuration.validation import explain
from rig.errors import UsageError

LOGGER = "logger"
"""Name the logger goes under among the devices."""


@dataclass(frozen=True, slots=True)
class Problem:
    """One thing that is wrong, the part of the configuration it stands in, and what to write."""

    key: str
    what: str
    fix: str


def problems(config: Config) -> list[Problem]:
    """Return the problems of a configuration beyond its keys and ranges; empty when sound."""
    sections: dict[str, DeviceSection] = {LOGGER: config.logger, **config.devices}
    found = [p for name, section in sections.items() for p in _driver_problems(name, section)]
    carried_by = settings_of(config.logger.profile).drivers
    if carried_by is not None and config.logger.driver not in carried_by:
        what = f"The driver {config.logger.driver} cannot run a {config.logger.profile}."
        fix = " or ".join(f'driver = "{name}"' for name in carried_by)
        found.append(Problem(LOGGER, what, f"Write {fix}."))
    if LOGGER in config.devices:
        found.append(Problem(f"devices.{LOGGER}", "The name is the logger's.", "Choose another."))
    found += _name_problems(config)
    sound = {n: s for n, s in sections.items() if not any(p.key == _key(n) for p in found)}
    return found + _bus_problems(sound)


def refuse_problems(config: Config) -> None:
    """Refuse a configuration with problems; the UsageError names each and what to write."""
    found = problems(config)
    if found:
        raise UsageError(
            f"The configuration of {config.name} cannot be used.",
            "\n".join(f"{p.key}: {p.what}" for p in found),
            "\n".join(dict.fromkeys(p.fix for p in found)),
        )


def _name_problems(config: Config) -> list[Problem]:
    """Return the keys that name a missing model or set of calibrations."""
    found = []
    if config.model_path is not None and not config.model_path.is_file():
        known = [p.name.removesuffix(".model.toml") for p in SHIPPED.glob("*.model.toml")]
        found.append(_unknown("model", str(config.model), sorted(known)))
    calibration = Path(config.calibration)
    known = sorted(path.stem for path in SHIPPED_CALIBRATIONS.glob("*.toml"))
    is_there = calibration.is_file() if calibration.suffix == ".toml" else str(calibration) in known
    if not is_there:
        found.append(_unknown("calibration", config.calibration, known))
    return found


def _unknown(key: str, name: str, known: list[str]) -> Problem:
    what = f"There is no {key} {name!r}: neither a file nor shipped."
    return Problem(key, what, f"Name a file, or a shipped one. {nearest(name, known)}")


def _driver_problems(name: str, section: DeviceSection) -> list[Problem]:
    key = _key(name)
    try:
        named = driver(section.driver)
    except UnknownDriverError as error:
        return [Problem(key, error.what, error.fix or error.why)]
    found = _option_problems(key, named, section.options)
    on_can = section.url.startswith("can:")
    if is_simulated(section.url):
        if named.name not in fakes():
            what = f"The driver {named.name} has no fake."
            found.append(Problem(key, what, "Write the url of the device in place of sim://."))
    elif on_can and named.can is None:
        found.append(Problem(key, f"The driver {named.name} is on no CAN bus.", "Change its url."))
    elif named.can is not None and not on_can:
        what = f"The driver {named.name} needs a CAN bus."
        found.append(Problem(key, what, "Write e.g. can:socketcan:can0."))
    return found


def _option_problems(key: str, named: Driver, options: Mapping[str, Any]) -> list[Problem]:
    """Hold options against the types and ranges of the parameters they become."""
    parameters = list(inspect.signature(named.open, eval_str=True).parameters.values())[1:]
    fields: dict[str, Any] = {
        p.name: (Any if p.annotation is p.empty else p.annotation, p.default) for p in parameters
    }
    rules = ConfigDict(extra="forbid", strict=True, arbitrary_types_allowed=True)
    try:
        create_model(named.name, __config__=rules, **fields).model_validate(options)
    except ValidationError as error:
        what = f"Options of the driver {named.name}: {explain(error, fields)}"
        fix = f"Choose from: {', '.join(fields)}." if fields else "It has no options."
        return [Problem(key, what, fix)]
    return []


@dataclass(frozen=True, slots=True)
class _OnBus:
    name: str
    identifiers: frozenset[int]
    bit_rate: int


def _bus_problems(sections: Mapping[str, DeviceSection]) -> list[Problem]:
    buses: dict[str, list[_OnBus]] = {}
    found = []
    for name, section in sections.items():
        if not section.url.startswith("can:"):
            continue
        named = driver(section.driver)
        if (use := named.can) is None:
            continue
        bus, _, query = section.url.partition("?")
        options = {**named.options, **section.options}
        place = _OnBus(name, use.identifiers(options), section.bit_rate or use.bit_rate)
        said = dict(parse_qsl(query)).get("bitrate")
        if said is not None and said != str(place.bit_rate):
            what = f"Its url sets {said} bit/s, the device has {place.bit_rate} bit/s."
            fix = f"Write one bit rate; set `bit_rate` in [{_key(name)}] to the device's own."
            found.append(Problem(_key(name), what, fix))
        buses.setdefault(bus, []).append(place)
    for bus, places in buses.items():
        found += [p for one, other in combinations(places, 2) for p in _clash(bus, one, other)]
        if len(places) > 1 and bus.split(":")[1] in ("slcan", "gs_usb"):
            names = " and ".join(place.name for place in places)
            what = f"{names} are on one adapter, which can be opened once."
            found.append(Problem(bus, what, "Use socketcan, or an adapter for each."))
    return found


def _clash(bus: str, one: _OnBus, other: _OnBus) -> list[Problem]:
    """Return the conflicts of two devices on one bus."""
    found = []
    shared = sorted(one.identifiers & other.identifiers)
    if shared:
        numbers = ", ".join(f"{number:#05x}" for number in shared[:4])
        more = f" and {len(shared) - 4} more" if len(shared) > 4 else ""
        what = f"{one.name} and {other.name} share the identifiers {numbers}{more}."
        fix = "Give them two buses, or another base or node number (a NETCANOEM: base 0x68)."
        found.append(Problem(bus, what, fix))
    if one.bit_rate != other.bit_rate:
        what = f"{one.name} has {one.bit_rate} bit/s and {other.name} {other.bit_rate} bit/s."
        fix = "Set both to one bit rate and write it as `bit_rate`, or give them two buses."
        found.append(Problem(bus, what, fix))
    return found


def _key(name: str) -> str:
    return name if name == LOGGER else f"devices.{name}"
