"""The functions of one variable that a formula is made of, at the shapes a search tries."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from estimation.diagnosis.balance import Balance
from estimation.diagnosis.candidate import Candidate
from estimation.diagnosis.variables import ORDERS, PLAYS, PROJECTED, Basis
from estimation.effects.roles import CHANNELS as PLAYED_BY
from estimation.effects.unknown_product import product, product_id
from estimation.recording import FloatArray


@dataclass(frozen=True)
class Unary:
    """A function of one variable at one shape; None for the constant."""

    form: str | None
    channel: str
    shape: tuple[float, ...] = ()


def live_channel(balance: Balance, basis: Basis) -> str | None:
    """Return the channel that a model reads for a variable, or None where it has none."""
    measured = {made: own for own, made in PROJECTED.items()}
    channel = measured.get(basis.channel, basis.channel)
    if channel == balance.model.target:
        # the balance's own sensor is what is estimated: another tells it
        role = "load" if basis.variable == "load" else "position"
        (channel, *_) = PLAYED_BY.get(balance.model.balance, {}).get(role, ("",))
    return channel if all(channel in run.channels for run in balance.runs) else None


def word(basis: Basis) -> str:
    """Return what a formula calls a variable."""
    if basis.variable == "history":
        return re.sub(r"_rad$|_m$|(?<=joint_\d)_.*", "", basis.channel)
    return "velocity" if basis.variable == "velocity_sign" else basis.variable


def library(basis: Basis, channel: str) -> list[Unary]:
    """Return the functions of one variable that are tried."""
    span, low, high = basis.high - basis.low, basis.low, basis.high

    def made(form: str, *shapes: tuple[float, ...]) -> list[Unary]:
        found = [Unary(form, channel, shape) for shape in shapes or ((),)]
        return [one for one in found if _in_bounds(one)]

    if basis.variable == "history":
        return made("play", *((0.5 * share * span,) for share in PLAYS))
    if basis.variable == "motor_angle":
        waves = [(float(k),) for k in range(1, ORDERS + 1)]
        return made("sine", *waves) + made("cosine", *waves)
    signs = made("sign", *((share * span,) for share in (0.005, 0.02, 0.08)))
    if basis.variable == "velocity_sign":
        return signs
    waves = [(2 * math.pi * turns / span,) for turns in (0.5, 1.0, 2.0, 3.0)]
    places = [float(x) for x in np.linspace(low, high, 9)]
    bumps = [(w * span, c / (w * span)) for w in (0.08, 0.15, 0.3) for c in places]
    steps = [(0.05 * span, c / (0.05 * span)) for c in places[1:-1]]
    found = [*made("value"), *made("square"), *made("cube")]
    found += made("sine", *waves) + made("cosine", *waves)
    found += made("bump", *bumps) + made("step", *steps)
    return found + made("absolute") + signs if low < 0 < high else found


def _in_bounds(one: Unary) -> bool:
    """Say whether a model can hold the shape: no narrow bump on a channel far from zero."""
    kind = product(product_id(one.form)) if one.form else None
    bounds = kind.shape if kind else ()
    return all(p.lower <= x <= p.upper for p, x in zip(bounds, one.shape, strict=True))


def values(functions: Sequence[Unary], channels: Mapping[str, FloatArray]) -> FloatArray:
    """Return the functions on a whole run, shape (n, functions)."""
    length = len(next(iter(channels.values())))
    columns = []
    for unary in functions:
        kind = product(product_id(unary.form)) if unary.form else None
        if kind is None:
            columns.append(np.ones(length))
        else:
            columns.append(kind.columns({"first": channels[unary.channel]}, unary.shape)[:, 0])
    return np.column_stack(columns)


def named(*unary: Unary) -> list[str]:
    """Return the forms, without the constant."""
    return [one.form for one in unary if one.form]


def candidate(*factors: Unary) -> Candidate:
    """Return the product of functions as a term of a model, on the side of the estimate."""
    factors = tuple(one for one in factors if one.form)
    return Candidate(
        product_id(*named(*factors)),
        1,
        tuple(zip(("first", "second"), (one.channel for one in factors), strict=False)),
        tuple(value for one in factors for value in one.shape),
    )
