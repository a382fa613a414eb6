"""Units of a table's columns, converted to the SI unit of a channel.

A unit is a product of powers with an optional number: `deg`, `mm/s`, `mN m`, `rev/4096` (an encoder
of 4096 counts a turn), `0.4/255 A` (eight bits of a current). An angle is a dimension of its own
here: with a unit library for which radian is the number one, degrees would pass for a ratio,
counts for radians, and revolutions per minute for hertz.
"""

import math
import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass

from estimation.channels import UnknownUnitError, unit_of

TURN = 2 * math.pi
G_M_S2 = 9.80665

BASE: dict[str, tuple[float, dict[str, int]]] = {
    "1": (1.0, {}),
    "ratio": (1.0, {}),
    "%": (0.01, {}),
    "count": (1.0, {"count": 1}),
    "counts": (1.0, {"count": 1}),
    "rad": (1.0, {"rad": 1}),
    "deg": (math.radians(1), {"rad": 1}),
    "°": (math.radians(1), {"rad": 1}),
    "rev": (TURN, {"rad": 1}),
    "turn": (TURN, {"rad": 1}),
    "rpm": (TURN / 60, {"rad": 1, "s": -1}),
    "s": (1.0, {"s": 1}),
    "min": (60.0, {"s": 1}),
    "h": (3600.0, {"s": 1}),
    "Hz": (1.0, {"s": -1}),
    "m": (1.0, {"m": 1}),
    "in": (0.0254, {"m": 1}),
    "ft": (0.3048, {"m": 1}),
    "l": (1e-3, {"m": 3}),
    "L": (1e-3, {"m": 3}),
    "N": (1.0, {"N": 1}),
    "gf": (1e-3 * G_M_S2, {"N": 1}),
    "lbf": (4.4482216152605, {"N": 1}),
    "ozf": (4.4482216152605 / 16, {"N": 1}),
    "g": (1e-3, {"kg": 1}),
    "lb": (0.45359237, {"kg": 1}),
    "A": (1.0, {"A": 1}),
    "V": (1.0, {"V": 1}),
    "Pa": (1.0, {"N": 1, "m": -2}),
    "bar": (1e5, {"N": 1, "m": -2}),
    "psi": (4.4482216152605 / 0.0254**2, {"N": 1, "m": -2}),
    "K": (1.0, {"K": 1}),
    "Nm": (1.0, {"N": 1, "m": 1}),
    "Ncm": (1e-2, {"N": 1, "m": 1}),
    "Nmm": (1e-3, {"N": 1, "m": 1}),
}
"""Symbol to its factor to SI and its powers of base symbols; `BASE` without `PREFIXES`."""

MICRO = dict.fromkeys("uµμ", 1e-6)
PREFIXES = {"": 1.0, "n": 1e-9, **MICRO, "m": 1e-3, "c": 1e-2, "h": 1e2, "k": 1e3, "M": 1e6}
PREFIXED = ("s", "m", "l", "L", "N", "Nm", "g", "gf", "A", "V", "Hz", "Pa", "bar", "rad", "deg")

SHIFTED = {"degC": (1.0, 273.15), "°C": (1.0, 273.15), "degF": (5 / 9, 459.67 * 5 / 9)}
"""Temperatures whose zero is not that of kelvin: K = factor * value + shift."""

FACTOR = re.compile(r"(?P<symbol>[^\W\d]+|[%°]C?)(?:\^?(?P<power>-?\d+))?")
NUMBER = re.compile(r"\d+(\.\d*)?([eE][-+]?\d+)?|\.\d+")
SIZE = re.compile(rf"(?P<size>-?(?:{NUMBER.pattern}))(?:/(?P<parts>{NUMBER.pattern}))?(?:\s+|$)")
"""A number, or a ratio of two, at the beginning of a unit."""


IN_BRACKETS = re.compile(r"[\[(]\s*([^\])]+?)\s*[\])]\s*$")
"""A unit in brackets at the end of a column's name: `speed (rpm)`, `q [deg]`."""

UNMISTAKABLE = (
    *("deg", "°", "mdeg", "mrad", "rpm", "rev", "%", "degC", "°C", "degF", "us", "ms", "ns"),
    *("um", "µm", "mm", "cm", "uA", "mA", "mV", "kV", "mN", "kN", "kgf", "lbf"),
    *("ozf", "mNm", "Nmm", "Ncm", "kNm", "bar", "mbar", "psi", "kPa", "MPa", "kHz"),
)
"""Units that are one at the end of a column's name without brackets, too: `angle_deg`, `I/mA`.

Single letters and words, such as `a`, `g`, `in` and `min`, are not: most of them mean a part, an
input or a least value."""

ALONE = ("deg", "°", "rpm", "mNm", "degC", "°C")
"""Those that a channel of another dimension is refused for, too: no part is called so."""

PLAIN = {"rad": "rad", "s": "s", "m": "m", "min": "min", "n": "N"}
"""What may stand with one of them: `v_mm_s`, `speed deg/s`."""

ALIKE = 1e-3
"""Relative difference of two factors that are one, such as 9.81 and 9.80665."""

IN_WORDS = {unit.lower(): unit for unit in UNMISTAKABLE} | PLAIN


class NotAUnitError(ValueError):
    """A text is not a unit."""


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit: SI value = factor * value + shift, and its powers of base symbols."""

    factor: float
    powers: dict[str, int]
    shift: float = 0.0


def read_unit(text: str) -> Unit:
    """Read a unit such as `mm/s`, `N m`, `rev/4096` or `degC`; NotAUnitError where it is none."""
    text = text.strip()
    if text in SHIFTED:
        factor, shift = SHIFTED[text]
        return Unit(factor, {"K": 1}, shift)
    factor, powers = 1.0, dict[str, int]()
    if (size := SIZE.match(text)) and float(size["parts"] or 1):
        factor = float(size["size"]) / float(size["parts"] or 1)
        text = text[size.end() :] or "1"
    for place, part in enumerate(text.split("/")):
        way = 1 if place == 0 else -1
        words = [w for w in re.split(r"[\s*·]+", part.strip(" ()")) if w]
        if not words:
            raise NotAUnitError(f"{text!r} is not a unit")
        for word in words:
            base_size, own, power = _word(word, text)
            factor *= base_size ** (way * power)
            for base, count in own.items():
                powers[base] = powers.get(base, 0) + way * power * count
    return Unit(factor, {base: count for base, count in powers.items() if count})


def _word(word: str, text: str) -> tuple[float, dict[str, int], int]:
    if NUMBER.fullmatch(word):
        return float(word), {}, 1
    found = FACTOR.fullmatch(word)
    symbol = found["symbol"] if found else word
    power = int(found["power"] or 1) if found else 1
    if symbol in BASE:
        return *BASE[symbol], power
    for prefix, size in PREFIXES.items():
        rest = symbol.removeprefix(prefix)
        if prefix and rest != symbol and rest in PREFIXED:
            return size * BASE[rest][0], BASE[rest][1], power
    raise NotAUnitError(f"{text!r} is not a unit: {word!r} is not known")


def conversion(unit: str, name: str) -> Unit | None:
    """Return how values in a unit become the SI unit that a channel's name ends in.

    None where the unit has another dimension than the channel. `count` fits only a ratio.

    Raises:
        NotAUnitError: The unit cannot be read.
        UnknownUnitError: The channel's name has no unit.
    """
    given = read_unit(unit)
    wanted = read_unit(unit_of(name))
    same = given.powers == wanted.powers
    return Unit(given.factor / wanted.factor, given.powers, given.shift) if same else None


def as_unit(text: str) -> str:
    """Return the unit that a text is, in small letters if need be; nothing where it is none."""
    for unit in (text, IN_WORDS.get(text.lower(), text)):
        with suppress(NotAUnitError):
            read_unit(unit)
            return unit
    return ""


def agree(stated: str, unit: str, gain: float, name: str) -> bool | None:
    """Return whether a file and a mapping state the same unit of a column; None if unreadable.

    Unit and gain are what the mapping states; no unit means the SI unit of the channel. A gain may
    turn one unit into the other, and any unit into one of another dimension.
    """
    if not as_unit(stated):
        return None
    given = read_unit(as_unit(stated))
    wanted, used = read_unit(unit_of(name)), read_unit(unit or unit_of(name))
    if given.powers != wanted.powers:
        sized = bool(unit) and "count" in given.powers  # such as rev/4096
        return sized or gain != 1.0
    sizes = (used.factor, abs(gain) * used.factor)
    return given.shift == used.shift and any(
        math.isclose(given.factor, s, rel_tol=ALIKE) for s in sizes
    )


def stated_in_name(column: str, name: str) -> str:
    """Return the unit at the end of a column's name, where it is not the unit of its channel.

    Such as of `angle_deg`, `I/mA` or `speed (rpm)`; nothing where the name ends in none, in that of
    the channel, or in one of another dimension that may be a word.
    """
    for stated in _candidates(column):
        with suppress(NotAUnitError, UnknownUnitError):
            unit = conversion(stated, name)
            if stated in ALONE if unit is None else (unit.factor, unit.shift) != (1.0, 0.0):
                return stated
    return ""


def contradicted_by_name(column: str, unit: str, gain: float, name: str) -> str:
    """Return the unit at the end of a column's name that contradicts a mapping, or nothing.

    One of another dimension counts in brackets, such as `Force [kN]`, or where no part is called
    so. The arguments are those of `agree`.
    """
    found = ""
    for stated in _candidates(column):
        agreed = agree(stated, unit, gain, name)
        if agreed:
            return ""
        if agreed is False and (conversion(as_unit(stated), name) or _is_a_unit(column, stated)):
            found = found or as_unit(stated)
    return found


def _is_a_unit(column: str, stated: str) -> bool:
    """Return whether a unit of another dimension at the end of a name can be no word."""
    if not IN_BRACKETS.search(column):
        return stated in ALONE
    return bool(read_unit(as_unit(stated)).powers) and ("[" in column or stated in UNMISTAKABLE)


def _candidates(column: str) -> Iterator[str]:
    """Yield the units that the end of a column's name may state."""
    if found := IN_BRACKETS.search(column):
        yield from (found[1], found[1].lower())
        return
    words = [word for word in re.split(r"[_/ ]+", column) if word.lower() != "per"]
    for first in range(1, len(words)):
        units = [IN_WORDS.get(word.lower(), "") for word in words[first:]]
        if all(units) and set(units) - set(PLAIN.values()):
            yield from ("/".join(units), " ".join(units))
