"""What a search may add to a balance: every effect of the catalogue that may enter it."""

from collections.abc import Collection

from estimation.derived import measured_channels
from estimation.effects import catalogue
from estimation.effects.roles import entries
from estimation.model import Term


def candidates(balance: str, available: Collection[str]) -> list[Term]:
    """Return the terms that may be added to a balance, without values.

    An effect comes once for each way its roles may be played, such as a delay of either of two
    sensors.

    Args:
        balance: Balance id, such as `motor` or `joint.3`.
        available: Measured channels of the recordings.
    """
    there = set(available)
    return [
        Term(effect, entry.sign, entry.channels)
        for effect in catalogue().values()
        for entry in entries(effect, balance)
        if set(measured_channels(entry.channels.values())) <= there
    ]
