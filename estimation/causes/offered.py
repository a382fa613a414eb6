"""Which effects of the catalogue a search offers at a place, and in which forms."""

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

from scipy.signal import detrend

from estimation.causes.angles import angles_of, travel_of
from estimation.causes.grids import axis, has_both_signs, last_order, least_order, turns
from estimation.causes.layout import Layout
from estimation.causes.orders import largest_orders, orders_elsewhere
from estimation.causes.places import Place
from estimation.causes.run_signals import ANGLES, EFFORTS, SENSORS
from estimation.causes.sources import Source
from estimation.effects import Effect, catalogue

DECLARED_ONLY = (
    "arm.",
    "compliance.",
    "motor.torque_constant",
    "sensor.offset",
    "transmission.ratio",
    "transmission.damping",
)
DECLARED_FRICTION = ("friction.coulomb", "friction.viscous")
BEHIND_THE_BEND = (*DECLARED_FRICTION, "inertia.missing")
"""Losses that an equation of a torque declares, wherever they are.

Of those between a transmission and a torque sensor behind it, the bend has the size.
"""
SYNONYMS = ("friction.capstan",)
"""Effects that another one stands for.

Over a constant wrap a cable's pull is multiplied by cosh(wrap) + sinh(wrap) sign: the second part
is `friction.load`, the first one a factor of the load, which equations have.
"""
NOT_A_LOSS = (
    "motor.",
    "ripple.current",
    "ripple.sensor",
    "sensor.",
    "transmission.",
    "hysteresis.bouc_wen.twist",
    "change.step.offset",
    "inertia.missing",
)
OF_KIND: Mapping[str, tuple[str, ...]] = {
    "lever": ("eccentric.load.pulley",),
    "actuator": (
        "motor.",
        "ripple.current",
        "sensor.delay",
        "sensor.lag",
        "sensor.gain_nonlinear",
        "sensor.drift",
        "change.step.offset",
    ),
    "deflection": (
        "coupling.kinematic",
        "transmission.",
        "hysteresis.bouc_wen.twist",
        "hysteresis.presliding",
        "ripple.output",
        "eccentric.load",
    ),
    "torque sensor": (
        "sensor.gain_nonlinear",
        "sensor.gain_by_position",
        "ripple.sensor",
        "sensor.drift",
        "sensor.thermal",
        "sensor.creep",
        "sensor.hysteresis",
        "sensor.lag",
        "sensor.delay",
        "sensor.crosstalk",
        "change.step.offset",
    ),
    "angle sensor": (
        "sensor.encoder_inl",
        "sensor.delay",
        "sensor.lag",
        "change.step.offset",
    ),
}
"""Kind of a place to the effects that act there; at a loss all others act but some."""

FILTERS = (
    "sensor.delay",
    "sensor.lag",
    "motor.electrical",
    "transmission.relaxation",
)
"""Effects that pass a reading through a linear filter, as smoothing its noise does.

A creep does too, but so slowly that it takes much of the motion off with the noise.
"""

LOOPS = ("hysteresis.", "transmission.backlash", "sensor.hysteresis")
"""Effects with a loop: at a constant load they follow the noise of its reading."""

OF_LOAD = ("deflection", "torque sensor")
"""Kinds of places whose loops go over the reading of a load; others go over a travel."""

OVER_TIME = ("friction.warmup", "sensor.drift", "change.step", "motor.thermal")
"""Effects that a time in the run stands for."""

KNOWN = ("motor", "gearbox", "cable", "stretch", "grasp")
"""Equations of the reference rig that effects name."""

OF_FEW = (
    "friction.capstan",
    "inertia.position",
    "inertia.condition",  # its conditions are its loads, and its load has no mass
    "motor.condition",
    "motor.dead_zone",  # of a command: the rig's motor is read by its measured current
    "motor.gain_by_side",
    "motor.gain_by_position",  # a rotating motor has a ripple of its constant instead
    "sensor.gain_by_position",  # its torque sensors are in line with their shafts
    "ripple.sensor",
    "transmission.compliance_by_position",  # its cables have one free length
    "transmission.scale_error",  # its gears have teeth, and the ratio of its cable is a parameter
)
"""Families that the reference rig has in the equations that their effects name, and in no other."""

OF_ANY_ORDER = (
    "ripple.motor",
    "ripple.output",
    "ripple.sensor",
    "ripple.current",
    "eccentric.load",
)
"""Waves that a shaft may make which turns by another ratio; an encoder is on its own shaft."""

OF_TARGET = ("sensor.drift", "change.step.offset", "sensor.lag")
"""Effects of a drive that is an equation's target: a zero, a constant force, a late reading."""

BY_SIDE = ("motor.gain_by_side", "sensor.gain_nonlinear.by_side")
"""Gains of either side: of a reading that is nearly always of one sign, these are one gain."""

SERIES = ("inertia.position.harmonics",)
"""Effects of several harmonics of one turn: over less than a turn these are nearly the same."""


def sources_at(
    layout: Layout, place: Place, effects: Iterable[Effect] | None = None
) -> Iterator[Source]:
    """Yield every candidate at a place, of the whole catalogue or of some effects."""
    repeats = repeats_one_reference(layout)
    for effect in catalogue().values() if effects is None else effects:
        of_run_time = "clock" in effect.roles and effect.id.startswith(OVER_TIME)
        if not _acts(layout, effect, place) or (repeats and of_run_time):
            continue
        options = [[(role, c) for c in place.roles.get(role, ())] for role in effect.roles]
        for channels in itertools.product(*options):
            if any(c not in layout.runs[0].channels for _, c in channels):
                continue
            if effect.id in SERIES and not turns(layout, dict(channels)["position"]):
                continue
            if effect.id in BY_SIDE and not has_both_signs(layout, channels[0][1]):
                continue
            odd = _follows_noise(layout, place, effect, channels)
            axes = [axis(layout, place, effect, p, dict(channels)) for p in effect.shape]
            for shape in itertools.product(*axes):
                for parts in _parts(effect):
                    yield Source(place, effect, tuple(channels), shape, parts, odd)
            if effect.family in OF_ANY_ORDER:
                yield from _between(layout, Source(place, effect, tuple(channels), (), (), odd))


def _between(layout: Layout, wave: Source) -> Iterator[Source]:
    """Yield a wave at the orders that are not whole and that the error shows most."""
    angle = dict(wave.channels)[wave.turning]
    if not angle.endswith("_angle_rad"):
        return  # the periods of a position are on the grid
    factors = [channel for role, channel in wave.channels if role != wave.turning]
    least, most = least_order(layout, angle), last_order(layout, wave.effect, angle)
    orders, tried = largest_orders(layout, wave.place.home, angle, factors, least, most)
    (parts,) = _parts(wave.effect)
    for order in orders:
        if not _is_whole_elsewhere(layout, wave.effect, angle, order):
            yield replace(wave, shape=(order,), parts=parts, tried=tried)


def _is_whole_elsewhere(layout: Layout, effect: Effect, angle: str, order: float) -> bool:
    """Whether an order of an angle is, within what the runs resolve, a whole one of another shaft.

    What turns with that shaft makes it then; no belt nor gear that nobody declared is needed.
    """
    return any(
        abs(there - round(there)) <= 2.0 * math.pi / travel_of(layout, other)
        for other, there in orders_elsewhere(layout, angle, order)
        if 0.5 < there <= last_order(layout, effect, other)
    )


def _follows_noise(
    layout: Layout, place: Place, effect: Effect, channels: Sequence[tuple[str, str]]
) -> bool:
    """Whether an effect follows noise of a reading that is also in some equation's residual.

    An angle has so little noise that only a linear filter shows it.
    """
    readings = [c for _, c in channels if c in layout.measured]
    if effect.id.startswith(LOOPS) and effect.start() and place.kind in OF_LOAD:
        readings = [c for c in readings if not c.endswith(ANGLES)]
    elif not effect.id.startswith(FILTERS):
        return False
    return any(
        (c, entry.equation) not in layout.independent for c in readings for entry in place.enters
    )


def repeats_one_reference(layout: Layout) -> bool:
    """Whether all runs repeat one motion, so that time within a run is the motion's phase."""
    angle = next(iter(angles_of(layout)), "")
    if not angle or len(layout.runs) < 2:
        return False
    size = min(len(r.channels[angle]) for r in layout.runs)
    # less the mean speed: shafts that turn one way have angles that grow alike
    moves = [detrend(r.channels[angle][:size]) for r in layout.runs]
    first = moves[0]
    return all(
        float(first @ m) > 0.99 * math.sqrt(float(first @ first) * float(m @ m)) for m in moves[1:]
    )


def _acts(layout: Layout, effect: Effect, place: Place) -> bool:
    if effect.id == "ripple.motor.harmonics" and "output_angle" in place.roles:
        return False  # of several shafts, those that the motor drives have them
    if place.kind == "output":
        return effect.id in BEHIND_THE_BEND
    if effect.family in DECLARED_FRICTION or effect.id.startswith(DECLARED_ONLY):
        return False
    if effect.id in SYNONYMS:
        return False
    if effect.at_rest or effect.id == "coupling.torque":
        return False
    if not set(effect.roles) <= set(place.roles):
        return False
    kind = place.home.partition(".")[0]
    is_force = place.kind == "actuator" and place.roles["current"][0].endswith(EFFORTS)
    if is_force and not effect.id.startswith("motor."):
        return False  # a drive that is stated as a force has a sensor's place, too
    if (place.home, place.kind) == ("calibration.encoder", "deflection"):
        return False  # slower than a count a sample, the pattern of the counts passes for a bend
    if place.kind == "actuator" and effect.id.startswith(OF_TARGET):
        return layout.equations[place.home].target in place.roles["current"]
    is_known = kind in KNOWN and any(name in layout.measured for name in SENSORS)
    if effect.family in OF_FEW and is_known and kind not in effect.balances:
        return False  # a wrapped cable or a linkage, not a shaft in its bearings
    if place.kind == "actuator" and effect.id == "sensor.gain_nonlinear.by_side":
        return False  # the gain of a drive by its side
    of_sensor = effect.id == "ripple.sensor"
    of_torque = effect.family in ("ripple.motor", "ripple.output") and place.kind == "loss"
    is_wave = of_sensor or (of_torque and not is_known)
    if is_wave and of_sensor != (len(place.equations) > 1):
        return False  # the two have one form: in several equations it is the sensor's
    if (place.kind == "lever") != (effect.id == "eccentric.load.pulley"):
        return False
    if place.kind == "deflection" and effect.id.endswith(".lugre"):
        return False
    if place.kind == "loss":
        return not effect.id.startswith(NOT_A_LOSS)
    return effect.id.startswith(OF_KIND[place.kind])


def _parts(effect: Effect) -> list[tuple[int, ...]]:
    """Return the sets of columns that compete: all, and of a polynomial every part of it."""
    count = len(effect.amplitudes)
    everything = tuple(range(count))
    polynomial = effect.id.startswith(
        ("sensor.gain_nonlinear", "friction.position", "spring.position.curved")
    )
    if not polynomial:
        return [everything]
    return [p for k in range(1, count + 1) for p in itertools.combinations(everything, k)]
