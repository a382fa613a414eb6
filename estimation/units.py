"""Unit symbols as a product of powers: what a torque divided by a speed is called.

Parameters of an effect take their unit from the channels they are used with, so that the same
effect serves a torque equation and an angle equation.
"""

import re
from collections.abc import Mapping

from estimation.errors import EstimationError

Powers = dict[str, int]


class UnitError(EstimationError):
    """A unit symbol or a unit expression cannot be read."""


def _powers(symbol: str) -> Powers:
    """Read `N m s/rad` or `rad/s^2` as powers of its base symbols."""
    powers: Powers = {}
    for place, part in enumerate(symbol.split("/")):
        for factor in part.split():
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
    return f"{above}/{below}" if below else above


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
