"""A named cause as a term of an equation's model, to be saved in a file and run live."""

import math
from collections.abc import Collection, Mapping
from dataclasses import replace

from estimation.causes.equations import Equation
from estimation.causes.functions import Function
from estimation.causes.places import Entry
from estimation.causes.sources import Source
from estimation.derived import CLOCKS, measured_channels, origin_of
from estimation.effects.roles import entries
from estimation.model import Estimate, Term


def plain(cause: Source | Function) -> Source | Function:
    """Return a cause with the form of its equation, as a model has it."""
    return replace(cause, bend=None, odd=False) if isinstance(cause, Source) else cause


def term_of(source: Source, equation: Equation, measured: Collection[str]) -> Term | None:
    """Return a cause as a term of one equation, its shape set and its amplitudes not.

    A term never reads the equation's own target: the channel that `estimation.effects.roles` has
    for that role takes its place.

    Args:
        source: The cause.
        equation: The equation.
        measured: Channels that every run has.

    Returns:
        None where it does not enter the equation undifferentiated, or no other channel can take the
        target's place.
    """
    entry = _entry(source, equation.name)
    if entry is None:
        return None
    instead = _instead(source, equation, measured)
    channels = {}
    for role, channel in source.channels:
        name = instead.get(role, "") if _reads_target(channel, equation) else channel
        if not name:
            return None
        channels[role] = name
    shape = {
        p.name: Estimate(float(x)) for p, x in zip(source.effect.shape, source.shape, strict=True)
    }
    sign = int(math.copysign(1, entry.gain * source.side))
    return Term(source.effect, sign, channels, shape)


def _entry(source: Source, name: str) -> Entry | None:
    """Return how it enters an equation, if undifferentiated and with an effect."""
    own = [e for e in source.place.enters if e.equation == name and e.order == 0 and e.gain]
    return own[0] if own else None


def _reads_target(channel: str, equation: Equation) -> bool:
    return equation.target in (channel, origin_of(channel)[0])


def _instead(source: Source, equation: Equation, measured: Collection[str]) -> Mapping[str, str]:
    """Return role to a channel other than the target, where the equation has one."""
    there = {*measured, *CLOCKS}
    found: dict[str, str] = {}
    for entry in entries(source.effect, equation.name):
        for role, channel in entry.channels.items():
            known = set(measured_channels([channel], equation.model.signals)) <= there
            if known and not _reads_target(channel, equation):
                found.setdefault(role, channel)
    return found
