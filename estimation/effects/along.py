"""A gain that changes along the travel: the form that a sensor and a drive have alike."""

from estimation.effects.effect import Inputs, Parameter, Row

ORDERS = ("linear", "slope"), ("quadratic", "bend"), ("cubic", "twist")


def amplitudes_along(role: str) -> tuple[Parameter, ...]:
    """Return the changes of the factor of a role with the position, of first to third order."""
    return tuple(
        Parameter(
            name, " / ".join(["target", role, *["position"] * k]), f"{order} change with position"
        )
        for k, (order, name) in enumerate(ORDERS, start=1)
    )


def along(role: str, inputs: Inputs) -> Row:
    """Return a role times the first to third power of the position."""
    value, position = inputs[role], inputs["position"]
    return tuple(value * position**k for k in range(1, len(ORDERS) + 1))
