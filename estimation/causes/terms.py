"""A named cause as a term of an equation's model, to be saved in a file and run live."""

import math
from dataclasses import replace

from estimation.causes.equations import Equation
from estimation.causes.functions import Function
from estimation.causes.places import Entry
from estimation.causes.sources import Source
from estimation.derived import origin_of
from estimation.effects import effect
from estimation.model import Estimate, Term
from estimation.predicted import predicted_of


def plain(cause: Source | Function) -> Source | Function:
    """Return a cause with the form of its equation, as a model has it."""
    return replace(cause, bend=None, odd=False) if isinstance(cause, Source) else cause


def term_of(source: Source, equation: Equation) -> Term | None:
    """Return a cause as a term of one equation, its shape set and its amplitudes not.

    A term never reads the equation's own target: its prediction by the fitted equation takes its
    place, see `estimation.predicted`.

    Args:
        source: The cause.
        equation: The equation.

    Returns:
        None where it does not enter the equation undifferentiated, or nothing predicts the target.
    """
    entry = _entry(source, equation.name)
    if entry is None:
        return None
    if entry.load:
        return Term(
            effect("eccentric.load.harmonics"),
            int(math.copysign(1, entry.gain)),
            {**dict(source.channels), "load": entry.load},
            dict(zip(("order",), map(Estimate, source.shape), strict=True)),
        )
    target = equation.target
    own = {c for _, c in source.channels if target in (c, origin_of(c)[0])}
    channels = {r: predicted_of(c, target) if c in own else c for r, c in source.channels}
    if own and equation.model.signals.combination(predicted_of(target, target)) is None:
        return None
    shape = {
        p.name: Estimate(float(x)) for p, x in zip(source.effect.shape, source.shape, strict=True)
    }
    sign = int(math.copysign(1, entry.gain * source.side))
    return Term(source.effect, sign, channels, shape)


def _entry(source: Source, name: str) -> Entry | None:
    """Return how it enters an equation, if undifferentiated and with an effect."""
    own = [e for e in source.place.enters if e.equation == name and e.order == 0 and e.gain]
    return own[0] if own else None
