"""Terms of a formula outside the catalogue: products of elementary functions."""

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any, ClassVar, NamedTuple, cast

import numba
import numpy as np

from estimation.effects.effect import Effect, Parameter
from estimation.recording import FloatArray

UNKNOWN = "unknown"
ROLES = {"first": "spindle_angle_rad", "second": "motor_velocity_rad_s"}
MOST_FACTORS = len(ROLES)

_SCALES = (1e-6, 1e6)


class Form(NamedTuple):
    """One function of one variable.

    Attributes:
        of: Function of the variable's values and the shape.
        shape: Name, unit over the role `{role}`, and meaning of each shape parameter.
        power: Of the variable's unit.
    """

    of: Callable[..., Any]
    shape: tuple[tuple[str, str, str], ...] = ()
    power: int = 0


_WIDTH = ("width", "{role}", "width of the change")
_PLACE = ("place", "1", "position of its middle, in widths")
_ORDER = ("order", "1 / {role}", "radians per unit")
_TRAVEL = ("width", "{role}", "half the travel that crosses it")

FORMS: Mapping[str, Form] = {
    "value": Form(lambda x: x, power=1),
    "absolute": Form(np.abs, power=1),
    "square": Form(np.square, power=2),
    "cube": Form(lambda x: x * np.square(x), power=3),
    "sign": Form(lambda x, width: np.tanh(x / width), (_WIDTH,)),
    "sine": Form(lambda x, order: np.sin(order * x), (_ORDER,)),
    "cosine": Form(lambda x, order: np.cos(order * x), (_ORDER,)),
    "bump": Form(lambda x, width, place: np.exp(-np.square(x / width - place)), (_WIDTH, _PLACE)),
    "step": Form(
        lambda x, width, place: 0.5 * (1.0 + np.tanh(x / width - place)), (_WIDTH, _PLACE)
    ),
    "play": Form(lambda x, _: x, (_TRAVEL,)),  # computed by `followed`
}
"""Functions of one variable. `bump` is exp(-(x / width - place)^2), `step` rises from 0 to 1 within
about a width of its place, `play` is the position in a free travel of +-width."""


class Product(Effect):
    """A term of a formula: an amplitude times a function of one variable, or of each of two.

    Equation: torque = a f(first) g(second), f and g from `FORMS`, named in the id as in
    `unknown.sign.bump`.

    Source: a search over products of elementary functions, as in orthogonal matching pursuit (Pati,
    Rezaiifar and Krishnaprasad 1993). It has no physical interpretation.
    """

    forms: ClassVar[tuple[str, ...]]
    family = UNKNOWN

    def columns(self, inputs: Mapping[str, FloatArray], shape: Sequence[float]) -> FloatArray:
        """Return the one column, shape (n, 1)."""
        made: FloatArray = np.ones(len(next(iter(inputs.values()))))
        for form, values, own in self._factors(inputs, shape):
            if form == "play":
                crossed = np.empty(len(values))
                followed(np.ascontiguousarray(values), own[0], np.nan, crossed)
                made = made * crossed
            else:
                made = made * FORMS[form].of(values, *own)
        return made[:, None]

    def start(self) -> list[float]:
        """Return the follower of each factor with free travel: NaN before the first sample."""
        return [np.nan] * self.forms.count("play")

    def step(
        self, inputs: Mapping[str, float], shape: Sequence[float], state: list[float]
    ) -> Sequence[float]:
        """Return the one value."""
        made, played = 1.0, 0
        for form, value, own in self._factors(inputs, shape):
            if form == "play":
                crossed = np.empty(1)
                state[played] = followed(np.array([value]), own[0], state[played], crossed)
                made *= float(crossed[0])
                played += 1
            else:
                made *= float(FORMS[form].of(value, *own))
        return [made]

    def _factors(
        self, inputs: Mapping[str, Any], shape: Sequence[float]
    ) -> list[tuple[str, Any, Sequence[float]]]:
        """Return form, values and shape of each factor."""
        factors, at = [], 0
        for form, role in zip(self.forms, self.roles, strict=True):
            count = len(FORMS[form].shape)
            factors.append((form, inputs[role], shape[at : at + count]))
            at += count
        return factors

    def __reduce__(self) -> tuple[object, ...]:
        """Serialise by name, for other processes."""
        return product, (self.id,)


@cache
def product(name: str) -> Product | None:
    """Return the product of that id; None if the id is not of a product."""
    family, *forms = name.split(".")
    if family != UNKNOWN or not 1 <= len(forms) <= MOST_FACTORS or not set(forms) <= set(FORMS):
        return None
    roles = dict(list(ROLES.items())[: len(forms)])
    powers = (f" / {r}" * FORMS[f].power for r, f in zip(roles, forms, strict=True))
    unit = "".join(["target", *powers])
    kind = type(
        "Product",
        (Product,),
        {
            "__doc__": Product.__doc__,
            "id": name,
            "family": UNKNOWN,
            "forms": tuple(forms),
            "roles": roles,
            "amplitudes": (Parameter("amplitude", unit, "amplitude"),),
            "shape": tuple(
                _parameter(role, *known)
                for role, form in zip(roles, forms, strict=True)
                for known in FORMS[form].shape
            ),
        },
    )
    return cast(Product, kind())


def _parameter(role: str, name: str, unit: str, meaning: str) -> Parameter:
    full, own = f"{role}_{name}", unit.format(role=role)
    if name == "place":
        return Parameter(full, own, meaning, -200.0, 200.0, linear=True, points=801)
    return Parameter(full, own, meaning, *_SCALES, points=124)


@numba.njit(cache=True)
def followed(values: FloatArray, half: float, follower: float, crossed: FloatArray) -> float:
    """Write the position within a free travel, -1 to 1, into `crossed`; return the follower.

    Args:
        values: Driving values, shape (n,); a value that is not finite gives NaN and has no effect.
        half: Half the free travel, in their unit.
        follower: Position of the driven side before the first value; NaN takes the first value.
        crossed: Shape (n,), written.
    """
    for k in range(len(values)):
        value = values[k]
        if np.isfinite(value):
            if np.isfinite(follower):
                follower = min(max(follower, value - half), value + half)
            else:
                follower = value
        crossed[k] = (value - follower) / half
    return follower
