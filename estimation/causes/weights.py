"""The weights of derivatives of a reading that an error of the reading has spoilt.

An error of an encoder grows by its derivatives. Where it is a wave of an acceleration's own size,
the declared inertia fitted without it is far too small, and the error is then sought in that
equation with the wrong weight. Here the weights are fitted next to the error, whose shape comes
from the equations that read it undifferentiated.
"""

from collections.abc import Sequence
from dataclasses import replace

from estimation.causes.candidates import Claim, Group, groups_of
from estimation.causes.folds import Folds
from estimation.causes.joint import Joint
from estimation.causes.places import Place, places_of
from estimation.causes.scoring import Scored, assessed, best_of_each
from estimation.causes.sources import Source


def reweighted(joint: Joint, pool: Sequence[Group], folds: Folds) -> list[Claim]:
    """Return errors of readings that equations differentiate, with weights fitted next to them."""
    plain = [
        group.within(undifferentiated)
        for group in pool
        if (undifferentiated := _undifferentiated(group.candidates[0].cause.place))
    ]
    seeds = [one for one in best_of_each(assessed(joint, plain, folds)) if one.score > 0.0]
    return [claim for one in seeds if (claim := _reweighted(joint, one)) is not None]


def _undifferentiated(place: Place) -> set[str]:
    """Return the equations that a reading's error enters as it is, if it enters others too."""
    derived = {e.equation for e in place.enters if e.order}
    plain = {e.equation for e in place.enters} - derived
    return plain if place.kind == "angle sensor" and derived else set()


def _reweighted(joint: Joint, one: Scored) -> Claim | None:
    candidate, layout = one.candidate, joint.layout
    cause = candidate.cause
    if not isinstance(cause, Source):
        return None
    free = joint
    for entry in cause.place.enters:
        if entry.order:  # each with an amplitude of its own, so that no weight matters
            alone = Claim(replace(cause, place=replace(cause.place, enters=(entry,))))
            for group in groups_of(joint, [alone]):
                free = free.with_cause(group.laid, group.precision[0])
    changed = {}
    for name in {e.equation for e in cause.place.enters if e.order}:
        weights = free.weights_of(name)
        equation = layout.equations[name]
        changed[name] = replace(equation, channels={**equation.channels, **weights})
    places = places_of(replace(layout, equations={**layout.equations, **changed}))
    own = next(place for place in places if place.name == cause.place.name)
    return Claim(replace(cause, place=own), candidate.acts, candidate.choices)
