"""A target predicted by its own fitted equation: what an effect reads instead of the target.

A term that reads its own target would explain the target's noise. A fitted equation of terms that
are proportional to a channel, and of Coulomb friction, is a channel of the machine, so that it is
read live too.
"""

from collections.abc import Collection
from dataclasses import replace

from estimation.channels import ending_of
from estimation.derived import looks_back, origin_of
from estimation.effects import Proportional
from estimation.fit_problem import OFFSET
from estimation.model import Model
from estimation.signals import Combination, Direction, Share


def predicted_of(channel: str, target: str) -> str:
    """Return the name of a prediction, of a target or of a channel that is differentiated from it.

    That of `jaw_angle_rad` is `jaw_predicted_angle_rad`.
    """
    motion = (kind for kind in ("angle_rad", "position_m") if target.endswith(kind))
    stem = target.removesuffix(f"_{next(motion, ending_of(target))}")
    return f"{stem}_predicted{channel.removeprefix(stem)}"


def with_prediction(model: Model, noisy: Collection[str] = ()) -> Model:
    """Return a fitted model whose signals have the prediction of its target.

    There is none where a term is neither proportional to a channel nor Coulomb friction: the other
    terms alone differ from the target by more than its noise. Nor is there one where a term has a
    noisy channel: what reads the prediction would follow the noise that the term has in the error.
    """
    name = predicted_of(model.target, model.target)
    others = tuple(c for c in model.signals.combinations if c.name != name)
    known = replace(model.signals, combinations=others)
    shares, turns = [], []
    for term in model.terms:
        if term.effect.id == OFFSET:
            continue
        (channel, *_) = term.channels.values() or ("",)
        if channel in noisy:
            return replace(model, signals=known)
        if isinstance(term.effect, Proportional) and not looks_back([channel]):
            shares.append(Share(channel, times=term.weights[0]))
        elif term.effect.id == "friction.coulomb":
            turns.append(Direction(channel, term.weights[0], term.values["width"].value))
        else:
            return model
    if not shares or len(turns) > 1:
        return model
    made = Combination(name, tuple(shares), next(iter(turns), None))
    return replace(model, signals=replace(known, combinations=(*known.combinations, made)))


def without_unused(model: Model) -> Model:
    """Return a model without the prediction of its target where no term reads it."""
    name = predicted_of(model.target, model.target)
    if name in {origin_of(channel)[0] for channel in model.channels}:
        return model
    kept = tuple(c for c in model.signals.combinations if c.name != name)
    return replace(model, signals=replace(model.signals, combinations=kept))
