"""The factors between units that are confused, in words."""

import math

FACTORS = {
    math.degrees(1.0): "the degrees of a radian",
    2.0 * math.pi: "the radians of a turn",
    360.0: "the degrees of a turn",
    30.0 / math.pi: "the revolutions a minute of a radian a second",
    10.0: "a step of ten",
    60.0: "the seconds of a minute",
    25.4: "the millimetres of an inch",
    100.0: "the step from centi, or per cent",
    1e3: "the step from milli",
    1e6: "the step from micro",
}
"""Factor between two units to what it is."""

NEAR = 0.03
"""Share by which a factor may differ from that of two units, unless another is stated."""


def unit_factor(factor: float, near: float = NEAR) -> str:
    """Return the two units whose factor, or its inverse, a factor is, in words; else nothing."""
    size = _size(factor)
    nearest = min(FACTORS, key=lambda one: abs(size / one - 1.0))
    return FACTORS[nearest] if abs(size / nearest - 1.0) < near else ""


def off_by(factor: float) -> str:
    """Return which units have a factor, a sentence after a space; empty where none have it."""
    words = unit_factor(factor)
    return f" That is off by {_size(factor):.3g}, {words}." if words else ""


def _size(factor: float) -> float:
    """Return a factor or its inverse, whichever is larger, without sign; zero stays zero."""
    return max(abs(factor), 1.0 / abs(factor)) if factor else 0.0
