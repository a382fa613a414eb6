"""Declared terms that have another factor in some of the runs: a payload, another gain."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from estimation.causes.blocks import Products
from estimation.causes.candidates import Claim
from estimation.causes.equations import Layout
from estimation.causes.instruments import instrumented
from estimation.causes.joint import Joint
from estimation.causes.places import places_of
from estimation.causes.sources import Source
from estimation.effects import effect
from estimation.fit_problem import OFFSET


@dataclass(frozen=True)
class Moved(Source):
    """A declared term with another factor.

    Attributes:
        column: Number of its equation's declared column; None of an offset or a sensor's gain.
    """

    column: int | None = None

    @property
    def is_declared(self) -> bool:
        """A declared term; an offset and a sensor's gain are in no column."""
        return self.column is not None

    @property
    def is_bounded(self) -> bool:
        """A parameter moves either way."""
        return False

    @property
    def side(self) -> int:
        """The sign of its term is in how it enters."""
        return 1


def amplitudes_of(layout: Layout) -> Iterator[Moved]:
    """Yield every amplitude of the declared terms, offsets included, at its equation's place."""
    places = {place.name: place for place in places_of(layout)}
    for equation in layout.equations.values():
        own, column = places[equation.name], 0
        for term in equation.model.terms:
            own_effect, of_all_runs = term.effect, term.effect.id == OFFSET
            entries = [e for e in own.enters if e.equation == equation.name]
            signed = tuple(replace(entry, gain=float(term.sign)) for entry in entries)
            place = replace(own, enters=signed)
            channels = tuple((role, term.channels[role]) for role in own_effect.roles)
            shape = tuple(term.numbers(own_effect.shape))
            for k in range(len(own_effect.amplitudes)):
                at = None if of_all_runs else column + k
                yield Moved(place, own_effect, channels, shape, (k,), column=at)
            if not of_all_runs:
                column += len(own_effect.amplitudes) + len(own_effect.shape)


def drives_of(layout: Layout) -> Iterator[Moved]:
    """Yield the gain of every drive that is an equation's target, read as the equation predicts."""
    for place in places_of(layout):
        target = layout.equations[place.home].target
        known = layout.runs[0].channels
        if place.name == f"actuator {target}" and instrumented(target, place.home) in known:
            yield Moved(place, effect("motor.torque_constant"), (("source", target),), (), (0,))


def moved_terms(joint: Joint) -> list[tuple[Claim, Products]]:
    """Return the declared terms as causes that act in no run yet, with their products by run.

    In all runs they are the base itself, so they compete only for acting in some. So does the gain
    of a drive that is the target, by which all terms differ alike.
    """
    usual, weights = joint.left_out([[]]).base[0], joint.weights
    out = []
    for one in (*amplitudes_of(joint.layout), *drives_of(joint.layout)):
        part = one.place.home, "within"
        terms = np.zeros(joint.size + 1)
        if one.column is not None:
            terms[joint.at[part][one.column]] = 1.0
        elif one.place.kind == "actuator":
            terms[joint.at[part]] = -usual[joint.at[part]]
        else:
            continue
        products = weights[part] * joint.gram[part] @ terms[:, None]
        base = products[:, :-1]
        cross = products[:, -1] - np.einsum("b,rbk->rk", usual, base)
        out.append((Claim(one), Products(base, (terms @ products)[..., None], cross)))
    return out
