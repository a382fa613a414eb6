"""Hidden effects: physics the simulated rig can hold and an estimator's model does not declare.

Each effect is a compiled function (`hidden_drive`, `hidden_cable`, `hidden_sensors`) of the plant's
own quantities and one row of a table, kept here: a strength and up to two numbers that shape it.
Strength 0 does not change the plant at all. Strength 1 is clear but not dominant. On the default
rig, low-passed at 50 Hz, effects of drive and gear are a quarter to three quarters of the residual
variance of a linear equation of motor current; effects of cable and jaw add 4 to 7 mN m rms to
proximal torque or 1 to 5 mrad to the jaw angle.

The forms are these modules' own and are deliberately not those an estimator would try first
(rational functions in place of exponentials, side bands, contact damping), so that finding an
effect is not recognising one's own formula.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rig.errors import UsageError


@dataclass(frozen=True, slots=True)
class Shape:
    """One number that shapes an effect: its name and unit, and the range it is drawn from."""

    name: str
    low: float
    high: float
    whole: bool = False

    @property
    def middle(self) -> float:
        """The value used when none is given."""
        return self.rounded(0.5 * (self.low + self.high))

    def rounded(self, value: float) -> float:
        """Return a value as this number may have it."""
        return float(round(value)) if self.whole else value

    def drawn(self, random: np.random.Generator) -> float:
        """Return a value drawn from the range."""
        return self.rounded(float(random.uniform(self.low, self.high)))


@dataclass(frozen=True, slots=True)
class Kind:
    """One kind of hidden effect."""

    name: str
    shapes: tuple[Shape, ...]  # up to two numbers of its row
    strongest: float = 1.4  # largest strength `draw` gives
    # whether it shows in a campaign of usual runs, so that `draw` may pick it: alike in all runs,
    # with the wrist held
    alone: bool = True


WEAKEST = 0.7
"""Smallest strength `draw` gives."""


def _kind(name: str, *shapes: Shape, strongest: float = 1.4, alone: bool = True) -> Kind:
    return Kind(name, shapes, strongest, alone)


_ORDER = Shape("periods_per_turn", 2.0, 6.0, whole=True)
_PHASE = Shape("phase_rad", 0.0, 2.0 * math.pi)
_SPOT = Shape("spindle_angle_rad", -0.75, -0.3)

KINDS = (
    _kind("motor_ripple", _ORDER, _PHASE),
    _kind("gear_load_friction", Shape("knee_torque_n_m", 0.02, 0.05)),
    _kind("gear_stribeck", Shape("motor_speed_rad_s", 6.0, 14.0)),
    _kind(
        "gear_backlash",
        Shape("half_gap_rad", 0.005, 0.01),
        Shape("contact_damping_s_rad", 0.01, 0.05),
    ),
    _kind("gear_eccentricity", Shape("periods_per_turn", 12.0, 20.0, whole=True), _PHASE),
    _kind("torque_constant_sag", Shape("current_a", 0.1, 0.3)),
    _kind("current_sensor_bend", Shape("current_a", 0.08, 0.2)),
    _kind("cable_position_friction", _SPOT, Shape("width_rad", 0.1, 0.25)),
    _kind("cable_presliding", Shape("displacement_rad", 0.1, 0.3)),
    _kind("cable_creep", Shape("time_s", 0.3, 1.5)),
    _kind("jaw_spring", Shape("rest_angle_rad", 0.5, 1.0), Shape("softening_rad", 0.3, 0.8)),
    _kind("end_stop_spring", Shape("contact_angle_rad", 0.8, 1.0)),
    _kind("motor_asymmetry", Shape("motor_speed_rad_s", 0.5, 2.0)),
    _kind("motor_drag", Shape("motor_speed_rad_s", 16.0, 24.0)),
    _kind("current_ripple", _ORDER, _PHASE),
    _kind("winding_heat", Shape("time_s", 3.0, 8.0)),
    _kind("torque_lag", Shape("time_s", 0.0014, 0.0022), strongest=1.2),
    _kind("gear_stiffening", Shape("twist_rad", 0.008, 0.016)),
    _kind("gear_two_state", Shape("motor_speed_rad_s", 12.0, 20.0)),
    _kind("gear_angle_viscous", Shape("spindle_angle_rad", -0.65, -0.4)),
    _kind(
        "cable_growing_friction",
        Shape("spindle_angle_rad", -1.2, -1.0),
        Shape("width_rad", 0.3, 0.6),
    ),
    _kind("cable_load_notch", _SPOT, Shape("width_rad", 0.1, 0.2)),
    _kind("friction_step", Shape("time_s", 5.0, 10.0)),
    _kind("cable_hysteresis", Shape("stretch_rad", 0.02, 0.04)),
    _kind("spindle_ripple", Shape("periods_per_turn", 12.0, 30.0), _PHASE),
    _kind("eccentric_pulley", Shape("periods_per_turn", 7.0, 14.0), _PHASE),
    _kind("jaw_mass"),
    _kind("jaw_detent", Shape("jaw_angle_rad", 0.5, 0.9), Shape("width_rad", 0.08, 0.16)),
    _kind("proximal_bend", Shape("torque_n_m", 0.08, 0.15)),
    _kind("proximal_creep", Shape("time_s", 0.4, 1.2)),
    _kind("proximal_lag", Shape("time_s", 0.02, 0.04)),
    _kind("distal_drift", Shape("time_s", 3.0, 9.0)),
    _kind("distal_crosstalk", Shape("current_a", 0.2, 0.5)),
    _kind("jaw_delay", Shape("delay_tick", 12.0, 28.0)),
    _kind("jaw_encoder_wave", Shape("periods_per_turn", 10.0, 24.0), _PHASE),
    _kind("motor_viscous_asymmetry", Shape("motor_speed_rad_s", 1.0, 4.0)),
    _kind("gear_load_viscous", Shape("motor_speed_rad_s", 60.0, 120.0)),
    _kind("grease_warmup", Shape("time_s", 2.0, 6.0)),
    _kind("gear_wear", alone=False),
    _kind("cable_stiff", alone=False),
    _kind("cable_dwell", Shape("slip_rad", 0.05, 0.15)),
    _kind("cable_capstan", Shape("wrap", 0.4, 0.6)),
    _kind("wrist_capstan", Shape("friction", 0.7, 1.0), alone=False),
    _kind("wrist_pull", Shape("bow", 0.1, 0.4), alone=False),
    _kind(
        "wrist_pinch",
        Shape("wrist_angle_rad", -0.25, 0.25),
        Shape("width_rad", 0.1, 0.2),
        alone=False,
    ),
    _kind("jaw_weight", Shape("level_angle_rad", 0.5, 0.9)),
)
"""Every kind of hidden effect."""

NAMES = tuple(kind.name for kind in KINDS)

SUMS = {
    "motor_friction": (
        "gear_load_friction", "gear_stribeck", "motor_asymmetry", "motor_drag", "gear_two_state",
        "gear_angle_viscous", "motor_viscous_asymmetry", "gear_load_viscous", "grease_warmup",
        "gear_wear",
    ),
    "spindle_friction": (
        "cable_position_friction", "cable_growing_friction", "cable_load_notch", "friction_step",
        "cable_stiff", "cable_dwell", "cable_capstan", "wrist_capstan", "wrist_pinch",
    ),
    "jaw_torque": ("jaw_spring", "end_stop_spring", "jaw_detent", "jaw_weight"),
}  # fmt: skip
"""What is worked out only where one of these is on."""

TABLE = np.dtype(
    [(kind.name, np.float64, 3) for kind in KINDS] + [(name, np.bool_) for name in SUMS]
)
"""The effects as compiled code reads them: a row of each, and whether any of a sum is on."""

STRENGTH, FIRST, SECOND = range(3)
"""Places in a row."""

Row = Sequence[float]
"""One row of the table; the compiled code passes an array."""


class UnknownHiddenEffectError(UsageError):
    """The configuration names a hidden effect that does not exist, or shapes it wrongly."""


@dataclass(frozen=True, slots=True)
class HiddenEffect:
    """One hidden effect of `NAMES` switched on."""

    name: str
    strength: float = 1.0  # 0 is off, 1 is clear
    # the numbers of `Kind.shapes` in order; those left out take the middle of their range
    shape: tuple[float, ...] = ()


def draw(seed: int) -> HiddenEffect:
    """Pick one effect that shows by itself, its strength and its shape by seed."""
    generator = np.random.default_rng(seed)
    kinds = [kind for kind in KINDS if kind.alone]
    kind = kinds[int(generator.integers(len(kinds)))]
    strength = float(generator.uniform(WEAKEST, kind.strongest))
    return HiddenEffect(kind.name, strength, tuple(part.drawn(generator) for part in kind.shapes))


def table(effects: Iterable[HiddenEffect]) -> NDArray[np.void]:
    """Return the table the compiled plant reads: one record of `TABLE`.

    Raises:
        UnknownHiddenEffectError: A name is unknown, a strength is negative or not finite, a kind is
            named twice, or a shape has too many numbers.
    """
    rows = np.zeros(1, TABLE)
    for kind in KINDS:  # read at strength 0 too, to no effect
        rows[kind.name][0, 1 : 1 + len(kind.shapes)] = [shape.middle for shape in kind.shapes]
    for effect in effects:
        if effect.name not in NAMES:
            raise UnknownHiddenEffectError(
                f"Unknown hidden effect {effect.name!r}.", f"Known: {', '.join(NAMES)}."
            )
        shapes, row = KINDS[NAMES.index(effect.name)].shapes, rows[effect.name][0]
        if not 0.0 <= effect.strength < math.inf:
            raise UnknownHiddenEffectError(
                f"Hidden effect {effect.name!r} has strength {effect.strength}.",
                "A strength is a finite number, 0 or more.",
            )
        if row[STRENGTH]:
            raise UnknownHiddenEffectError(f"Hidden effect {effect.name!r} is named twice.")
        if len(effect.shape) > len(shapes):
            raise UnknownHiddenEffectError(
                f"Hidden effect {effect.name!r} is shaped by {len(effect.shape)} numbers.",
                f"It takes: {', '.join(shape.name for shape in shapes)}.",
            )
        row[: 1 + len(effect.shape)] = [effect.strength, *effect.shape]
    for name, parts in SUMS.items():
        rows[name] = any(rows[part][0, STRENGTH] for part in parts)
    return rows


def chosen(words: Sequence[str] | None, seed: int) -> dict[str, float]:
    """Return the hidden effects requested by the user: effect to strength.

    The words are `effect` or `effect=strength`; `none` alone is for nothing; one is drawn by the
    seed when there are no words.

    Raises:
        UnknownHiddenEffectError: A name is unknown or a strength is not a number.
    """
    if not words:
        drawn = draw(seed)
        return {drawn.name: round(drawn.strength, 3)}
    if list(words) == ["none"]:
        return {}
    found = {}
    for word in words:
        name, _, strength = word.partition("=")
        try:
            found[name] = float(strength or 1.0)
        except ValueError as error:
            raise UnknownHiddenEffectError(
                f"{strength!r} is not a strength.", "Write for example motor_ripple=0.5."
            ) from error
    table(HiddenEffect(name, strength) for name, strength in found.items())
    return found
