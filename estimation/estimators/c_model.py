"""A fitted model as C: its effects without memory, written down by evaluating them on symbols."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from estimation.effects import Effect
from estimation.effects.effect import Pointwise
from estimation.errors import EstimationError
from estimation.estimators.model import fitted_range, rest_speeds, usual_half_width
from estimation.model import Model

UNARY: Mapping[np.ufunc, str] = {
    np.negative: "(-{0})",
    np.absolute: "fabs({0})",
    np.square: "({0} * {0})",
    **{
        getattr(np, n): f"{n}({{0}})"
        for n in ("tanh", "exp", "expm1", "sin", "cos", "sqrt", "log1p")
    },
    np.sign: "(({0} > 0) - ({0} < 0))",
}
BINARY: Mapping[np.ufunc, str] = {
    np.add: "({0} + {1})",
    np.subtract: "({0} - {1})",
    np.multiply: "({0} * {1})",
    np.divide: "({0} / {1})",
    np.power: "pow({0}, {1})",
    np.maximum: "fmax({0}, {1})",
    np.minimum: "fmin({0}, {1})",
    np.greater: "({0} > {1})",
    np.less: "({0} < {1})",
}
"""NumPy function to its C."""


class NotInCError(EstimationError):
    """An effect cannot be written as C."""


class Symbol(np.lib.mixins.NDArrayOperatorsMixin):
    """A C expression that takes part in NumPy's arithmetic."""

    def __init__(self, text: str) -> None:
        self.text = text

    def __array_ufunc__(self, function: np.ufunc, method: str, *inputs: Any, **_: Any) -> "Symbol":
        form = {**UNARY, **BINARY}.get(function) if method == "__call__" else None
        if form is None:
            raise NotInCError(f"The function {function.__name__} is not written as C.")
        return Symbol(form.format(*(text_of(value) for value in inputs)))


def text_of(value: Any) -> str:
    """Return an expression or a number as C."""
    return value.text if isinstance(value, Symbol) else repr(float(value))


def model_text(model: Model, place: Callable[[str], int]) -> str:
    """Return the C function that estimates a fitted model's target from a row of channels.

    `place` returns a channel's place in the row.

    Raises:
        NotInCError: An effect has memory, or uses a function that is not written as C.
        NotFittedError: A parameter has no value.
    """
    lines = []
    for term in model.terms:
        row = {
            channel: Symbol(f"(double)row[{place(channel)}]" if channel != "time_s" else "NAN")
            for channel in term.reads
        }
        inputs = {role: row[channel] for role, channel in term.channels.items()}
        shape = term.numbers(term.effect.shape)
        columns = _columns(term.effect, inputs, shape)
        if gains := term.passed(row, shape, model.low_pass):
            columns = [f"{x} * {text_of(g)}" for x, g in zip(columns, gains, strict=True)]
        for weight, column in zip(term.weights, columns, strict=True):
            lines.append(f"    total += {float(weight)!r} * {column}; /* {term.effect.id} */")
            if "NAN" in column:
                raise NotInCError(
                    f"{term.effect.id} depends on the time.", "C has no clock of the campaign."
                )
    half_width = usual_half_width(model)
    width = "NAN" if half_width is None else repr(half_width)
    for speed, slowest in rest_speeds(model).items():  # as live, none at rest
        width = f"fabs((double)row[{place(speed)}]) < {slowest!r} ? NAN : {width}"
    known = fitted_range(model)
    valid = "1" if known is None else f"total >= {known[0]!r} && total <= {known[1]!r}"
    return "\n".join(
        [
            "static inline name_estimate name_model(const float *row) {",
            "    double total = 0;",
            "    (void)row;",
            *lines,
            f"    name_estimate found = {{ (float)total, (float)({width}), {valid} }};",
            "    return found;",
            "}",
        ]
    )


def _columns(effect: Effect, inputs: Mapping[str, Symbol], shape: Sequence[float]) -> list[str]:
    if effect.start():
        raise NotInCError(
            f"{effect.id} remembers the samples before.",
            "Only effects without memory are written as C.",
            "Take it out of the model, or export a state estimator.",
        )
    symbols: Any = inputs
    row = (
        effect.row(symbols, shape)
        if isinstance(effect, Pointwise)
        else effect.step(symbols, shape, [])
    )
    return [text_of(value) for value in row]
