"""Candidates of a search: every effect of the catalogue that applies to an equation."""

from collections.abc import Collection, Mapping

from estimation.derived import measured_channels
from estimation.effects import catalogue
from estimation.effects.roles import entries
from estimation.model import Term


def candidates(
    balance: str,
    available: Collection[str],
    instead: Mapping[str, str] | None = None,
    at_rest: bool = False,
) -> list[Term]:
    """Return the terms that may be added to an equation, without values.

    An effect appears once for each assignment of channels to its roles, such as a delay of either
    of two sensors.

    Args:
        balance: Id of the equation, such as `motor` or `joint.3`.
        available: Measured channels of the recordings.
        instead: Channel to its replacement here, such as a commanded current for the measured one.
        at_rest: Whether static samples count, so that effects of standstill are candidates.
    """
    there = set(available)
    played = instead or {}
    terms = [
        Term(effect, entry.sign, {r: played.get(c, c) for r, c in entry.channels.items()})
        for effect in catalogue().values()
        if at_rest or not effect.at_rest
        for entry in entries(effect, balance)
    ]
    return [t for t in terms if set(measured_channels(t.channels.values())) <= there]
