"""The channel registry: every column of a recording, its unit and which way is positive.

Column names carry their SI unit as a suffix (`spindle_angle_rad`). Closing motion of the jaw and
the torque that closes it are positive in every channel, so that torque constant, stiffness and
transmission ratio come out positive.

Parameters of an effect take their unit from the channels they are used with, so that the same
effect serves a torque equation and an angle equation: a unit is a product of powers.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass

from estimation.errors import EstimationError

UNIT_BY_SUFFIX: dict[str, str] = {
    "n_m_s_rad": "N m s/rad",
    "n_m_rad": "N m/rad",
    "rad_n_m": "rad/(N m)",
    "n_m_s": "N m/s",
    "rad_s2": "rad/s^2",
    "m_s2": "m/s^2",
    "rad_s": "rad/s",
    "m_s": "m/s",
    "m3_s": "m^3/s",
    "kg_s": "kg/s",
    "n_m_a": "N m/A",
    "n_s_per_m": "N s/m",
    "n_per_m": "N/m",
    "n_per_a": "N/A",
    "n_m": "N m",
    "hz": "Hz",
    "rad": "rad",
    "ratio": "1",
    "n": "N",
    "m": "m",
    "s": "s",
    "a": "A",
    "v": "V",
    "pa": "Pa",
    "k": "K",
    "kg": "kg",
}
"""Unit symbol of each name suffix; the longest suffix that matches wins.

A word `per` is where it would be another unit without: `_n_m` is N m."""

PLAIN_UNIT = {"N s^2/m": "kg", "N m s^2/rad": "kg m^2"}
"""Unit as it follows from channels, to the one that people write for it."""

ESTIMATED = "estimated_"
"""A column so prefixed holds an estimate, made live, of the channel its name goes on with. It may
lack values in samples that are valid."""


@dataclass(frozen=True, slots=True)
class Channel:
    """One column of a recording, with its SI unit symbol and, in words, its quantity and place."""

    name: str
    unit: str
    description: str


class UnknownUnitError(EstimationError):
    """A column name ends in no known unit suffix."""


def unit_of(name: str) -> str:
    """Return the SI unit symbol that a name such as `motor_current_a` ends in; see `ending_of`."""
    return UNIT_BY_SUFFIX[ending_of(name)]


def unit_or_none(name: str) -> str | None:
    """Return the SI unit symbol a name ends in; None where it ends in none."""
    try:
        return unit_of(name)
    except UnknownUnitError:
        return None


def ending_of(name: str) -> str:
    """Return the suffix of a name that states its unit, such as `n_m`.

    Raises:
        UnknownUnitError: The name has no known unit suffix.
    """
    parts = name.split("_")
    for start in range(1, len(parts)):
        suffix = "_".join(parts[start:])
        if suffix in UNIT_BY_SUFFIX:
            return suffix
    raise UnknownUnitError(
        f"The channel name {name!r} carries no unit.",
        "Every column is in SI units and its name ends in the unit.",
        "End it in its SI unit, such as motor_current_a or motor_temperature_k. The endings are"
        f" {', '.join(sorted(UNIT_BY_SUFFIX))}.",
    )


CHANNELS: dict[str, Channel] = {
    name: Channel(name, unit_of(name), description)
    for name, description in {
        "time_s": "device clock, starts near zero in each run",
        "campaign_time_s": "time since the campaign's first run began, derived",
        "motor_angle_rad": "drive motor shaft, before the gearhead",
        "spindle_angle_rad": "instrument spindle, after the gearhead",
        "jaw_angle_rad": "jaw, from the encoder of the load motor",
        "target_angle_rad": "commanded trajectory of the spindle",
        "motor_current_a": "measured current of the drive motor",
        "motor_command_ratio": "command to the current controller, 1 is full scale",
        "load_command_a": "current commanded to the load motor at the jaw",
        "proximal_torque_n_m": "torque sensor at the spindle",
        "distal_torque_n_m": "torque sensor at the jaw",
        "fsr_v": "amplified force-sensing resistor",
        "wrist_pitch_rad": "wrist pitch of the instrument",
        "wrist_roll_rad": "roll of the instrument shaft",
        "motor_temperature_k": "drive motor housing",
    }.items()
}
"""Registered channels of the grasper rig by name. Other names are allowed if they carry a unit."""


def plain_name(name: str) -> str:
    """Return the words of a channel's name without its unit."""
    return name.removesuffix(f"_{ending_of(name)}").replace("_", " ")


def describe(name: str) -> Channel:
    """Return the registered channel of that name, or one derived from the name's unit suffix."""
    return CHANNELS.get(name) or Channel(name, unit_of(name), plain_name(name))


Powers = dict[str, int]


class UnitError(EstimationError):
    """A unit symbol or a unit expression cannot be read."""


def _powers(symbol: str) -> Powers:
    """Read `N m s/rad`, `rad/(N m)` or `rad/N m` as powers of its base symbols."""
    powers: Powers = {}
    for place, part in enumerate(symbol.split("/")):
        for factor in part.removeprefix("(").removesuffix(")").split():
            match = re.fullmatch(r"([A-Za-z%]+|1)(?:\^(\d+))?", factor)
            if match is None:
                raise UnitError(f"The unit {symbol!r} cannot be read at {factor!r}.")
            if match[1] != "1":
                power = int(match[2] or 1) * (1 if place == 0 else -1)
                powers[match[1]] = powers.get(match[1], 0) + power
    return {name: power for name, power in powers.items() if power}


def _symbol(powers: Powers) -> str:
    def product(factors: Powers) -> str:
        return " ".join(n if p == 1 else f"{n}^{p}" for n, p in factors.items())

    above = product({n: p for n, p in powers.items() if p > 0}) or "1"
    below = product({n: -p for n, p in powers.items() if p < 0})
    if not below:
        return above
    return f"{above}/({below})" if " " in below else f"{above}/{below}"


def is_same(one: str, other: str) -> bool:
    """Whether two unit symbols are one, however they are written: `rad/N m` is `rad/(N m)`."""
    try:
        return _powers(one) == _powers(other)
    except UnitError:
        return False


def evaluate(expression: str, symbols: Mapping[str, str]) -> str:
    """Return the unit symbol of an expression such as `target / speed`: names, `*`, `/` and `1`.

    Raises:
        UnitError: The expression uses a name without a unit, or a symbol cannot be read.
    """
    words = expression.split()
    powers: Powers = {}
    for operator, name in zip(["*", *words[1::2]], words[::2], strict=True):
        if operator not in "*/" or (name != "1" and name not in symbols):
            raise UnitError(
                f"The unit expression {expression!r} cannot be read at {name!r}.",
                f"It may use: {', '.join(symbols)}.",
            )
        for base, power in _powers(symbols.get(name, "1")).items():
            powers[base] = powers.get(base, 0) + (power if operator == "*" else -power)
    return _symbol(powers)
