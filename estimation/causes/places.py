"""Where a cause can act, and how it then enters every equation.

A place's signature follows from the declared equations: the sensitivity of each equation to an
error of one reading, or to a torque at one shaft. A sensor's error enters every equation that reads
the sensor; a torque beyond a compliance bends it as well.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from estimation.causes.angles import angles_of, related, signals_of, unrelated
from estimation.causes.equations import LINKS, Equation, sensitivity
from estimation.causes.layout import Layout
from estimation.causes.run_signals import ANGLES, EFFORTS, SENSORS
from estimation.derived import CAMPAIGN_TIME, origin_of, rates_of

CLOCKS: Mapping[str, tuple[str, ...]] = {
    "clock": ("time_s",),
    "elapsed": (CAMPAIGN_TIME,),
    "campaign_clock": (CAMPAIGN_TIME,),
}
"""Role of a time to its channel, at every place."""

STATED = 1e-9
"""Share of its size by which a number that is stated varies within a run: by rounding."""

Kind = Literal["loss", "output", "actuator", "deflection", "lever", "torque sensor", "angle sensor"]


@dataclass(frozen=True)
class Entry:
    """How a cause enters one equation's residual: gain times its derivative of that order.

    Attributes:
        equation: The equation.
        gain: The gain.
        order: How many times it is differentiated by time.
        load: Channel of the load that its derivative by the angle is multiplied with; none if "".
    """

    equation: str
    gain: float
    order: int = 0
    load: str = ""


@dataclass(frozen=True)
class Place:
    """Where a cause acts.

    Attributes:
        name: What it is called: an equation, `torque at CHANNEL` or `sensor CHANNEL`.
        kind: Which effects can act there.
        home: Equation it is reported under.
        enters: How it enters the equations.
        roles: Role of an effect to the channels that can play it there.
        like: Equation of the reference rig with the same signs: `stretch` where an output's travel
            is the target, `gearbox` where the bend itself is.
        others: Position, speed and acceleration of each axis that no equation relates to it, and
            the readings of its equation that are no motion.
    """

    name: str
    kind: Kind
    home: str
    enters: tuple[Entry, ...]
    roles: Mapping[str, tuple[str, ...]]
    like: str = ""
    others: tuple[tuple[str, ...], ...] = ()

    @property
    def equations(self) -> tuple[str, ...]:
        """The equations that it enters, each once."""
        return tuple(dict.fromkeys(entry.equation for entry in self.enters))


SUPPLIES = ("_v", "_pa")
"""Endings of the conditions that a drive takes its effort from: a voltage or a pressure."""

WARMED = ("loss", "actuator", "deflection", "torque sensor")
"""Kinds of places whose effects may follow a measured temperature."""


def places_of(layout: Layout) -> list[Place]:
    """Return every place the declared equations know of."""
    found = []
    angles = angles_of(layout)
    for equation in layout.equations.values():
        own = related(layout, equation, angles)
        found.append(_own(layout, equation, own, angles))
        found += _actuators(equation, own)
    found = _one_of_each(found)
    signals = signals_of(layout)
    known = {*_computed(layout), *signals.loads}
    sensors = [n for n in layout.measured if n not in known]
    for sensor in sensors:
        if (both := _both(layout, sensor)) is not None:
            found += [*_behind(layout, sensor, *both, angles), *_levers(sensor, *both, angles)]
    found += [p for n in sensors if (p := _sensor(layout, n, angles)) is not None]
    warmth = tuple(n for n in signals.temperatures if n in layout.measured)
    supplies = tuple(n for n in layout.conditions if n.endswith(SUPPLIES))
    conditions = {"loss": layout.conditions, "actuator": supplies}
    for k, place in enumerate(found):
        if warmth and place.kind in WARMED:
            place = replace(place, roles={**place.roles, "temperature": warmth})
        if stated := conditions.get(place.kind):
            place = replace(place, roles={**place.roles, "condition": stated})
        found[k] = place
    return found


def _computed(layout: Layout) -> set[str]:
    """Return the channels that an arm's links were fitted for: no sensor reads them."""
    terms = [t for e in layout.equations.values() for t in e.terms]
    return {c for t in terms if t.effect.id.startswith(LINKS) for c in t.channels.values()}


def _motion(angle: str) -> dict[str, tuple[str, ...]]:
    """Return the channels of an angle's motion; none where no angle is read."""
    if not angle:
        return {}
    speed, acceleration = rates_of(angle)
    return {"speed": (speed,), "acceleration": (acceleration,), "travel": (angle,)}


def _shared(layout_angles: Sequence[str], position: str) -> dict[str, tuple[str, ...]]:
    """Return the roles of clocks, and those of angles as far as any is read."""
    roles = dict(CLOCKS)
    if layout_angles:
        roles["motor_angle"] = tuple(layout_angles[:1])
    if position:
        roles |= dict.fromkeys(("position", "stop"), (position,))
    if position.endswith("_angle_rad"):  # a carriage does not tilt
        roles["tilt"] = (position,)
    if len(layout_angles) > 1:  # a harmonic of the only shaft there is has one name
        roles["output_angle"] = (position,)
    return roles


def _position(angles: Sequence[str], own: str) -> str:
    """Return the angle that the place's shaft or its output turns by."""
    slow = [a for a in angles if a != angles[0]] or list(angles)
    return own if own in slow else next(iter(slow), "")


def _own_angle(equation: Equation, angles: Sequence[str]) -> str:
    for angle in angles:
        if equation.speed in _motion(angle)["speed"]:
            return angle
    if not angles:
        return ""
    if equation.of_angle:
        inside = [a for a in angles if a in equation.channels]
        known = equation.model.signals
        inside += [a for a in angles if sensitivity(equation.target, a, known) is not None]
        return inside[-1] if inside else angles[-1]
    return angles[0]


def _own(
    layout: Layout, equation: Equation, angles: Sequence[str], everywhere: Sequence[str]
) -> Place:
    """Return the place of an equation, by the angles of its shafts and those of all."""
    angle = _own_angle(equation, angles)
    roles = _motion(angle) | _shared(angles, _position(angles, angle))
    efforts = tuple(n for n in equation.channels if n.endswith(EFFORTS)) or (equation.target,)
    effort = efforts[0]
    roles |= {"load": efforts}
    if not angle:  # a curve over a force has the history of that force
        roles |= {"travel": (effort,)}
    if equation.of_angle:
        bending = "compliance.link"
        if effort == equation.target:  # nothing but its own inertia loads it
            bending = "inertia.missing"
            terms = [t.channels for t in equation.terms if t.effect.id == bending]
            roles |= {"load": tuple(t["acceleration"] for t in terms) or (effort,)}
        roles |= {"travel": (effort, *roles["travel"])}  # what bends has the history of its load
        roles |= {"other_angle": unrelated(layout, equation, everywhere)}
        if "output_angle" in roles:  # a wave comes from either shaft of a gear
            ends = tuple(a for a in angles if a != roles["output_angle"][0] and _share(equation, a))
            roles |= {"output_angle": (*roles["output_angle"], *ends)}
        bends = [t.sign for t in equation.terms if t.effect.id == bending]
        like = "stretch" if -1 in bends else "gearbox"
        enters = (Entry(equation.name, 1.0),)
        return Place(equation.name, "deflection", equation.name, enters, roles, like)
    sign = next((t.sign for t in equation.terms if t.effect.id.startswith("friction.")), 1)
    enters = (Entry(equation.name, float(sign)),)
    apart = [_motion(a) for a in everywhere if a not in angles]
    others = tuple((*m["travel"], *m["speed"], *m["acceleration"]) for m in apart)
    known = {c for played in (*roles.values(), *others) for c in played}
    if inputs := _inputs(layout, equation, known | set(everywhere)):
        others = (*others, inputs)
        pressed = (c for c in inputs if c.endswith("_pa"))  # a seal is, by a pressure
        roles |= {"load": (*efforts, *pressed)}
    return Place(equation.name, "loss", equation.name, enters, roles, others=others)


def _inputs(layout: Layout, equation: Equation, known: set[str]) -> tuple[str, ...]:
    """Return the readings that an equation has as terms and that are neither motion nor a drive.

    Such as the flow in a pipe, or a formula of several channels: no effect has a role for them.
    """
    found = [
        c
        for term in equation.terms
        if term.effect.id != "motor.torque_constant"
        for c in term.channels.values()
        if (c in layout.measured or _is_difference(equation, c))
        and c not in known
        and origin_of(c)[0] not in known
    ]
    return tuple(dict.fromkeys(found))


def _is_difference(equation: Equation, channel: str) -> bool:
    """Whether a channel combines readings that are not efforts, as the bend of two angles does."""
    known = equation.model.signals.combination(channel)
    return known is not None and not channel.endswith(EFFORTS)


def _actuators(equation: Equation, angles: Sequence[str]) -> Iterator[Place]:
    """Yield the places of the actuators that an equation reads as terms or as its target."""
    stated = equation.model.signals.actuators
    read = {
        channel: term.sign
        for term in equation.terms
        for channel in term.channels.values()
        if channel in stated or term.effect.id == "motor.torque_constant"
    }
    is_driven = equation.target in stated
    if not read and not is_driven and (equation.of_angle or equation.target.endswith(EFFORTS)):
        return
    driven = {equation.target: -1.0} if is_driven or not read else {}
    for current in (*read, *driven):
        roles = _shared(angles, _position(angles, next(iter(angles), ""))) | {
            "current": (current,),
            "drive": (current,),
            "reading": (current,),
        }
        share = abs(equation.channels.get(current, 0.0)) or 1.0  # amplitudes are of the constant's
        enters = (Entry(equation.name, driven.get(current) or read[current] * share),)
        yield Place(f"actuator {current}", "actuator", equation.name, enters, roles)


def _one_of_each(places: Sequence[Place]) -> list[Place]:
    """Return each place once: one actuator enters every equation that reads its current."""
    found: dict[str, Place] = {}
    for place in places:
        known = found.get(place.name)
        found[place.name] = (
            replace(known, enters=(*known.enters, *place.enters)) if known else place
        )
    return [*found.values()]


def _both(layout: Layout, sensor: str) -> tuple[Equation, Equation] | None:
    """Return the equations of a transmission's torque and of its bend that read a torque sensor."""
    reading = [e for e in layout.equations.values() if _share(e, sensor)]
    torque = [e for e in reading if not e.of_angle]
    if len(torque) != 1 or len(reading) < 2:
        return None
    at_gear = sensor in SENSORS and sensor == torque[0].target  # nothing is between the two
    return None if at_gear else (torque[0], next(e for e in reading if e.of_angle))


def _behind(
    layout: Layout, sensor: str, torque: Equation, bent: Equation, angles: Sequence[str]
) -> Iterator[Place]:
    """Yield the places of a torque between a compliance and a torque sensor behind it.

    The equation of the torque has friction and inertia already, wherever they are; the bend has the
    size of those behind it, at the second place.
    """
    enters = tuple(Entry(e.name, -x) for e in layout.equations.values() if (x := _share(e, sensor)))
    angle = _own_angle(bent, angles)
    roles = _motion(angle) | _shared(angles, angle) | {"load": (sensor,)}
    loss = Place(f"torque at {sensor}", "loss", torque.name, enters, roles)
    yield from (loss, replace(loss, kind="output", home=bent.name))


def _levers(
    sensor: str, torque: Equation, bent: Equation, angles: Sequence[str]
) -> Iterator[Place]:
    """Yield the places of a wheel that is not round, between a torque equation and a sensor.

    With the travel A(angle) the bend's equation c_in angle_in + c_out angle_out = A + ... has the
    ratio of its angles, and by virtual work of its torques, changed by the factor 1 - A'/c_in where
    the wheel turns with the driving side, and by 1 + A'/c_out where it turns with the driven one.
    """
    for angle in angles[1:]:
        share = _share(bent, angle)
        if not share or not angle.endswith("_angle_rad"):  # a carriage does not turn
            continue
        side = -1.0 if torque.speed in _motion(angle)["speed"] else 1.0
        gain = -side * _share(torque, sensor) / share
        enters = (Entry(bent.name, 1.0), Entry(torque.name, gain, load=sensor))
        roles = {"output_angle": (angle,)}
        yield Place(f"wheel of {angle} at {sensor}", "lever", bent.name, enters, roles)


def _entries(equation: Equation, channel: str) -> Iterator[Entry]:
    """Yield how an error of a channel enters an equation's target less its right-hand side."""
    sides = [(equation.target, 1.0), *((n, -w) for n, w in equation.channels.items())]
    for name, weight in sides:
        if (found := sensitivity(name, channel, equation.model.signals)) is not None:
            yield Entry(equation.name, weight * found[0], found[1])


def _share(equation: Equation, channel: str) -> float:
    """Return the factor of a reading in an equation's target less its right-hand side."""
    return sum(entry.gain for entry in _entries(equation, channel) if not entry.order)


def _is_stated(layout: Layout, channel: str) -> bool:
    """Whether a channel is a number of each run, as a weight is: no sensor reads it."""
    values = [run.on_grid(channel) for run in layout.runs]
    return all(float(np.ptp(x)) <= STATED * float(np.abs(x).max()) for x in values)


def _sensor(layout: Layout, channel: str, angles: Sequence[str]) -> Place | None:
    enters = [entry for e in layout.equations.values() for entry in _entries(e, channel)]
    if not enters:
        return None
    angle = channel.endswith(ANGLES)
    if not angle and (not channel.endswith(EFFORTS) or _is_stated(layout, channel)):
        return None  # an error of the current's reading is a change of the actuator's gain

    def suits(entry: Entry) -> tuple[bool, bool, bool]:
        of_angle = layout.equations[entry.equation].of_angle
        return entry.order == 0, of_angle == angle, entry.gain > 0

    home = max(enters, key=suits).equation
    read = [n for e in layout.equations.values() for n in e.channels]
    others = (*angles, *(n for n in read if n.endswith("_a")))
    roles = {
        "reading": (channel,),
        "creeping": (channel,),
        "encoder": (channel,),
        **CLOCKS,
        "other_reading": tuple(n for n in others if n != channel),
    }
    if not angle:
        along = tuple(related(layout, layout.equations[home], angles))
        roles |= {"position": along}
        roles |= {"turning_angle": tuple(a for a in along if a.endswith("_angle_rad"))}
    kind: Kind = "angle sensor" if angle else "torque sensor"
    return Place(f"sensor {channel}", kind, home, tuple(enters), roles)
