"""Hidden effects: physics the simulated rig can hold and an estimator's model does not declare.

Each effect is a compiled function of the plant's own quantities and one row of a table: a strength
and up to two numbers that shape it. Strength 0 leaves the plant exactly as it is, bit for bit: the
effect is not evaluated. Strength 1 is clear but not dominant. On the default rig, low-passed at
50 Hz, effects of drive and gear are a quarter to three quarters of the variance that a linear
balance leaves in motor current; effects of cable and jaw add 4 to 7 mN m rms to proximal torque or
1 to 5 mrad to the jaw angle.

The forms are this module's own and are deliberately not those an estimator would try first
(rational functions in place of exponentials, side bands, contact damping), so that finding an
effect is not recognising one's own formula.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from rig.errors import UsageError

STRENGTH, FIRST, SECOND = range(3)
"""Columns of the table the compiled code reads."""

Row = Sequence[float]
"""One row of the table; the compiled code passes a row of the array."""


@dataclass(frozen=True, slots=True)
class Shape:
    """One number that shapes an effect: what it is, with its unit, and the range it is drawn from.

    Attributes:
        name: Name with the unit.
        low: Smallest value drawn.
        high: Largest value drawn.
        whole: Whole numbers only.
    """

    name: str
    low: float
    high: float
    whole: bool = False

    @property
    def middle(self) -> float:
        """The value used when none is given."""
        middle = 0.5 * (self.low + self.high)
        return float(round(middle)) if self.whole else middle


@dataclass(frozen=True, slots=True)
class Kind:
    """One kind of hidden effect.

    Attributes:
        name: Name in the configuration.
        description: What it is and what shapes it.
        shapes: Up to two numbers of its row.
        weakest: Smallest strength `draw` gives.
        strongest: Largest strength `draw` gives.
    """

    name: str
    description: str
    shapes: tuple[Shape, ...]
    weakest: float = 0.7
    strongest: float = 1.4


_PHASE = Shape("phase_rad", 0.0, 2.0 * math.pi)

KINDS: tuple[Kind, ...] = (
    Kind(
        "motor_ripple",
        "torque ripple of the motor, k periods a turn, amplitude modulated once a turn",
        (Shape("periods_per_turn", 2.0, 6.0, whole=True), _PHASE),
    ),
    Kind(
        "gear_load_friction",
        "gear friction that grows with the torque the gear carries, softly at first",
        (Shape("knee_torque_n_m", 0.02, 0.05),),
    ),
    Kind(
        "gear_stribeck",
        "extra friction of motor and gear at low speed",
        (Shape("motor_speed_rad_s", 6.0, 14.0),),
    ),
    Kind(
        "gear_backlash",
        "lost motion in the gear, contact with damping that grows with penetration",
        (Shape("half_gap_rad", 5e-3, 10e-3), Shape("contact_damping_s_rad", 0.01, 0.05)),
    ),
    Kind(
        "gear_eccentricity",
        "wave in the gear's position along the spindle angle, with a second harmonic",
        (Shape("periods_per_turn", 12.0, 20.0, whole=True), _PHASE),
    ),
    Kind(
        "torque_constant_sag",
        "torque constant that falls with current",
        (Shape("current_a", 0.1, 0.3),),
    ),
    Kind(
        "current_sensor_bend",
        "gain of the current sensor that rises with current",
        (Shape("current_a", 0.08, 0.2),),
    ),
    Kind(
        "cable_position_friction",
        "tight spot of the cable at one spindle angle",
        (Shape("spindle_angle_rad", -0.75, -0.3), Shape("width_rad", 0.1, 0.25)),
    ),
    Kind(
        "cable_presliding",
        "friction of the cable that builds up over a displacement after each reversal",
        (Shape("displacement_rad", 0.1, 0.3),),
    ),
    Kind(
        "cable_creep",
        "part of the cable's tension that relaxes, faster when it is large",
        (Shape("time_s", 0.3, 1.5),),
    ),
    Kind(
        "jaw_spring",
        "softening spring between jaw and ground",
        (Shape("rest_angle_rad", 0.5, 1.0), Shape("softening_rad", 0.3, 0.8)),
    ),
    Kind(
        "end_stop_spring",
        "spring of rising stiffness near the closed end",
        (Shape("contact_angle_rad", 0.8, 1.0),),
    ),
)
"""Every kind of hidden effect; the place in this tuple is the row of the table."""

(
    MOTOR_RIPPLE,
    GEAR_LOAD_FRICTION,
    GEAR_STRIBECK,
    GEAR_BACKLASH,
    GEAR_ECCENTRICITY,
    TORQUE_CONSTANT_SAG,
    CURRENT_SENSOR_BEND,
    CABLE_POSITION_FRICTION,
    CABLE_PRESLIDING,
    CABLE_CREEP,
    JAW_SPRING,
    END_STOP_SPRING,
) = range(len(KINDS))

NAMES: tuple[str, ...] = tuple(kind.name for kind in KINDS)


class UnknownHiddenEffectError(UsageError):
    """The configuration names a hidden effect that does not exist, or shapes it wrongly."""


@dataclass(frozen=True, slots=True)
class HiddenEffect:
    """One hidden effect switched on.

    Attributes:
        name: One of `NAMES`.
        strength: 0 is off, 1 is clear.
        shape: The numbers of `Kind.shapes` in order; those left out take the middle of their range.
    """

    name: str
    strength: float = 1.0
    shape: tuple[float, ...] = ()


def draw(seed: int) -> HiddenEffect:
    """Pick one effect, its strength and its shape by seed."""
    generator = np.random.default_rng(seed)
    kind = KINDS[int(generator.integers(len(KINDS)))]
    strength = float(generator.uniform(kind.weakest, kind.strongest))
    shape = []
    for part in kind.shapes:
        value = float(generator.uniform(part.low, part.high))
        shape.append(float(round(value)) if part.whole else value)
    return HiddenEffect(kind.name, strength, tuple(shape))


def table(effects: Iterable[HiddenEffect]) -> NDArray[np.float64]:
    """Return the table the compiled plant reads, shape (number of kinds, 3).

    Raises:
        UnknownHiddenEffectError: A name is unknown, a strength is negative or not finite, a kind is
            named twice, or a shape has too many numbers.
    """
    rows = np.zeros((len(KINDS), 3))
    for effect in effects:
        if effect.name not in NAMES:
            raise UnknownHiddenEffectError(
                f"There is no hidden effect {effect.name!r}.", f"Known: {', '.join(NAMES)}."
            )
        place = NAMES.index(effect.name)
        shapes = KINDS[place].shapes
        if not 0.0 <= effect.strength < math.inf:
            raise UnknownHiddenEffectError(
                f"Hidden effect {effect.name!r} has strength {effect.strength}.",
                "A strength is a finite number, 0 or more.",
            )
        if rows[place].any():
            raise UnknownHiddenEffectError(f"Hidden effect {effect.name!r} is named twice.")
        if len(effect.shape) > len(shapes):
            raise UnknownHiddenEffectError(
                f"Hidden effect {effect.name!r} is shaped by {len(effect.shape)} numbers.",
                f"It takes: {', '.join(shape.name for shape in shapes)}.",
            )
        values = [*effect.shape, *(shape.middle for shape in shapes[len(effect.shape) :])]
        rows[place] = [effect.strength, *values, *[0.0] * (2 - len(values))]
    return rows


@numba.njit()
def motor_ripple_n_m(row: Row, motor_angle_rad: float) -> float:
    """Ripple at the motor shaft: A sin(k q + p) (1 + 0.35 sin q), A = 0.08 mN m at strength 1."""
    carrier = math.sin(row[FIRST] * motor_angle_rad + row[SECOND])
    return row[STRENGTH] * 0.08e-3 * carrier * (1.0 + 0.35 * math.sin(motor_angle_rad))


@numba.njit()
def gear_load_friction_n_m(row: Row, twist_torque_n_m: float) -> float:
    """Extra Coulomb level at the spindle: 0.15 T |T| / (|T| + T0)."""
    load = abs(twist_torque_n_m)
    return row[STRENGTH] * 0.15 * load * load / (load + row[FIRST])


@numba.njit()
def gear_stribeck_n_m(row: Row, motor_speed_rad_s: float) -> float:
    """Extra Coulomb level at the motor: F / (1 + x + x^3), x = |w| / w0, F = 0.35 mN m."""
    x = abs(motor_speed_rad_s) / row[FIRST]
    return row[STRENGTH] * 0.35e-3 / (1.0 + x + x * x * x)


@numba.njit()
def gear_backlash_n_m(
    row: Row, twist_rad: float, twist_rate_rad_s: float, stiffness: float
) -> float:
    """Contact torque: k p (1 + c p'), p = |twist| - gap, never pulling, in place of k twist."""
    penetration = abs(twist_rad) - row[STRENGTH] * row[FIRST]
    if penetration <= 0.0:
        return 0.0
    rate = twist_rate_rad_s if twist_rad > 0.0 else -twist_rate_rad_s
    torque = max(stiffness * penetration * (1.0 + row[SECOND] * rate), 0.0)
    return torque if twist_rad > 0.0 else -torque


@numba.njit()
def gear_eccentricity_rad(row: Row, spindle_angle_rad: float) -> float:
    """Position error of the gear: e (sin(n q + p) + 0.3 sin(2 n q)), e = 2 mrad at strength 1."""
    angle = row[FIRST] * spindle_angle_rad
    return row[STRENGTH] * 2e-3 * (math.sin(angle + row[SECOND]) + 0.3 * math.sin(2.0 * angle))


@numba.njit()
def gear_eccentricity_slope(row: Row, spindle_angle_rad: float) -> float:
    """Derivative of the position error with the spindle angle: what keeps it free of energy."""
    angle = row[FIRST] * spindle_angle_rad
    wave = math.cos(angle + row[SECOND]) + 0.6 * math.cos(2.0 * angle)
    return row[STRENGTH] * 2e-3 * row[FIRST] * wave


@numba.njit()
def torque_constant_sag_ratio(row: Row, current_a: float) -> float:
    """Factor of the torque constant: 1 - 0.25 x / (1 + x), x = |i| / i0; never negative."""
    x = abs(current_a) / row[FIRST]
    return max(1.0 - row[STRENGTH] * 0.25 * x / (1.0 + x), 0.0)


@numba.njit()
def current_sensor_bend_ratio(row: Row, current_a: float) -> float:
    """Factor of the measured current: 1 + 0.2 x^2 / (1 + x^2), x = i / i0."""
    x = current_a / row[FIRST]
    return 1.0 + row[STRENGTH] * 0.2 * x * x / (1.0 + x * x)


@numba.njit()
def cable_position_friction_n_m(row: Row, spindle_angle_rad: float) -> float:
    """Extra Coulomb level at the spindle: F / (1 + x^2)^2, x = (q - q0) / width, F = 15 mN m."""
    x = (spindle_angle_rad - row[FIRST]) / row[SECOND]
    bump = 1.0 / (1.0 + x * x)
    return row[STRENGTH] * 15e-3 * bump * bump


@numba.njit()
def cable_presliding_rate(row: Row, bristle: float, spindle_speed: float) -> float:
    """Rate of the bristle's bend u in -1..1: u' = w / z0 (1 - u^3 sgn w)."""
    bend = bristle * bristle * bristle
    return spindle_speed / row[FIRST] * (1.0 - (bend if spindle_speed > 0.0 else -bend))


@numba.njit()
def cable_presliding_n_m(row: Row, bristle: float) -> float:
    """Torque of the bent bristle on the spindle: F u, F = 12 mN m at strength 1."""
    return row[STRENGTH] * 12e-3 * bristle


@numba.njit()
def cable_creep_n_m(row: Row, strain_rad: float, stiffness: float) -> float:
    """Tension of the branch that relaxes: 0.2 k e, e the strain not yet relaxed."""
    return row[STRENGTH] * 0.2 * stiffness * strain_rad


@numba.njit()
def cable_creep_rate(row: Row, strain_rad: float) -> float:
    """Rate of relaxation: e (1 + |e| / 0.1 rad) / T."""
    return strain_rad * (1.0 + abs(strain_rad) / 0.1) / row[FIRST]


@numba.njit()
def jaw_spring_n_m(row: Row, jaw_angle_rad: float) -> float:
    """Torque that opposes closing: k x / (1 + |x| / x0), x = q - rest, k = 0.04 N m/rad."""
    x = jaw_angle_rad - row[FIRST]
    return row[STRENGTH] * 0.04 * x / (1.0 + abs(x) / row[SECOND])


@numba.njit()
def end_stop_spring_n_m(row: Row, jaw_angle_rad: float) -> float:
    """Torque that opposes closing: k p^1.5, p = q - contact, k = 0.15 N m at strength 1."""
    penetration = jaw_angle_rad - row[FIRST]
    if penetration <= 0.0:
        return 0.0
    return row[STRENGTH] * 0.15 * penetration * math.sqrt(penetration)
