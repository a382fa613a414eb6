"""The equations of motion that a machine's sensors allow, and what keeps others from being written.

Along the chain of axes that an actuator drives:

- from the actuator to the first sensor of effort: effort = gain x drive - inertia - friction;
- between two sensors of effort: effort = ratio x effort behind + inertia + friction;
- without a sensor of effort: drive = weights + inertia + friction, in the unit of the drive;
  a second drive of the axis is taken off, times the ratio of their gains; what a compliant
  transmission drives has an inertia of its own where its travel is read;
- across a compliant transmission with its travel read at both ends, there or a rigid transmission
  away, and its effort at one: the bend of known ratio, or the output's travel where the ratio is
  fitted, = compliance x effort.

Each has an offset. Friction goes with the speed of the axis on the driving side of what loses it:
a gearbox winds up before its output turns. Acceleration is taken from the driven axis, whose sensor
turns fastest.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

from estimation import plant_positions as positions
from estimation.channels import unit_of
from estimation.plant import (
    ACCELERATION,
    EFFORT,
    SPEED,
    Actuator,
    Part,
    Plant,
    PlantError,
    Transmission,
    Written,
)
from estimation.signals import Combination, Reading, Signals

OFFSET = Part("sensor.offset")
RATE = {"N m": "_rate_n_m_s"}
"""Unit of an effort to the ending of its rate."""


@dataclass(frozen=True)
class Missing:
    """What cannot be identified, and the sensor that would change it, a sentence each."""

    what: str
    needed: str


@dataclass(frozen=True)
class Chain:
    """The axes that an actuator drives, one after the other, and the transmissions between them."""

    actuator: Actuator
    axes: tuple[str, ...]
    joints: tuple[Transmission, ...]
    # further actuators of the first axis, such as the second motor of a gantry
    also: tuple[Actuator, ...] = ()


def equations(plant: Plant) -> tuple[Written, ...]:
    """Return the equations that the sensors allow, those of the machine's owner last.

    Raises:
        PlantError: Two equations have the same name.
    """
    found: dict[tuple[str, str], Written] = {}  # chains that branch share their beginning
    for chain in chains(plant):
        for equation in (*_efforts(plant, chain), *_deflections(plant, chain)):
            found.setdefault((equation.name, equation.target), equation)
    once = list(found.values())
    names = [e.name for e in (*once, *plant.equations)]
    for name in names:
        if names.count(name) > 1:
            own = [e.name for e in plant.equations]
            place = ("equation", own.index(name) + 1, "name") if name in own else ("machine", 1, "")
            raise PlantError(
                place,
                f"Two equations are called {name!r}.",
                f"The sensors allow: {', '.join(e.name for e in once)}.",
                "Rename the equation, the transmission or the axis, or name the equation of a"
                " transmission's bend with `deflection`.",
            )
    return (*_in_order(plant, once), *plant.equations)


def _in_order(plant: Plant, found: list[Written]) -> list[Written]:
    """Return equations along the chain: drive, loss of the gear, its bend, loss of the cable."""
    place: dict[str, int] = {}
    for chain in chains(plant):
        place.setdefault(chain.actuator.axis, len(place))
        for joint in chain.joints:
            place.setdefault(joint.name, len(place))
            place.setdefault(_bend_name(plant, joint), len(place))
    return sorted(found, key=lambda e: place[e.name])


def signals(plant: Plant) -> Signals:
    """Return the machine's derived channels and its speeds of standstill; see `equations`."""
    bends = [c for joint in plant.transmissions if (c := bend_channel(plant, joint)) is not None]
    speeds = {
        channel
        for equation in equations(plant)
        for part in equation.parts
        if part.id.startswith("friction.") and (channel := part.channels.get("speed")) is not None
    }
    rest = {}
    for axis in plant.axes:
        sensor, speed = plant.position(axis.name), plant.moved(axis.name, SPEED)
        if speed not in speeds:
            continue
        count = (sensor and sensor.step) or 0.0
        rest[speed] = count * plant.cutoff_hz if axis.rest_speed is None else axis.rest_speed
    stated = {s.name: Reading(s.noise, s.step, s.rate_hz, s.delay_s) for s in plant.sensors}
    named = {s.name for s in plant.sensors if s.reads in ("temperature", "position")}
    readings = {name: one for name, one in stated.items() if one != Reading() or name in named}
    joined, integrated = positions.joined(plant), integrals(plant)
    own = {*(s.name for s in plant.sensors), *integrated, *(c.name for c in plant.derived)}
    follow = (c for c in joined if c.name not in own)
    derived = (*bends, *follow, *positions.speeds(plant, integrated), *plant.derived)
    loads, actuators = (tuple(part.name for part in of) for of in (plant.loads, plant.actuators))
    return Signals(derived, rest, readings, joined, integrated, loads, actuators)


def integrals(plant: Plant) -> dict[str, str]:
    """Return the positions that are integrals of a measured speed, to that speed."""
    return positions.integrals(plant, _read(plant))


def chains(plant: Plant) -> Iterator[Chain]:
    """Yield the chain of every driven axis; where it branches, one chain an end."""
    for axis in dict.fromkeys(actuator.axis for actuator in plant.actuators):
        first, *also = (a for a in plant.actuators if a.axis == axis)
        yield from _onward(plant, Chain(first, (axis,), (), tuple(also)))


def _onward(plant: Plant, chain: Chain) -> Iterator[Chain]:
    further = [
        joint
        for joint in plant.transmissions
        if joint.input == chain.axes[-1] and joint.output not in chain.axes
    ]
    if not further:
        yield chain
    for joint in further:
        axes, joints = (*chain.axes, joint.output), (*chain.joints, joint)
        yield from _onward(plant, replace(chain, axes=axes, joints=joints))


def bend_channel(plant: Plant, joint: Transmission) -> Combination | None:
    """Return the channel of a transmission's bend, None where no sensors or no ratio give it."""
    read = positions.rigidly(plant)
    driving, driven = read.get(joint.input), read.get(joint.output)
    if not joint.compliant or joint.ratio is None or driving is None or driven is None:
        return None
    name = f"{joint.name}_differential_{plant.axis(joint.output).unit}"
    before = replace(driving, over=driving.over * joint.ratio)
    return Combination(name, (before, replace(driven, times=-driven.times)))


def _bend_name(plant: Plant, joint: Transmission) -> str:
    if joint.deflection:
        return joint.deflection
    loses = any(
        plant.effort(joint.output) and plant.effort(a) for c in chains(plant) for a in c.axes
        if joint in c.joints and c.axes.index(a) <= c.axes.index(joint.input)
    )  # fmt: skip
    return f"{joint.name}_stretch" if loses else joint.name


def _driven(plant: Plant, axes: tuple[str, ...]) -> str:
    """Return the first axis whose travel is read, else the first whose speed is; else empty."""
    sensors = (plant.position, plant.speed)
    return next((axis for read in sensors for axis in axes if read(axis)), "")


def _motion(plant: Plant, speed_of: str, acceleration_of: str, sign: int) -> list[Part]:
    """Return inertia and friction, as far as motion is measured."""
    parts = []
    if acceleration_of:
        acceleration = plant.moved(acceleration_of, ACCELERATION)
        parts.append(Part("inertia.missing", sign, {"acceleration": acceleration}))
    if speed_of:
        speed = plant.moved(speed_of, SPEED)
        parts.append(Part("friction.viscous", sign, {"speed": speed}))
        parts.append(Part("friction.coulomb", sign, {"speed": speed}))
    return parts


def _swung(plant: Plant, chain: Chain, driven: str) -> Iterator[Part]:
    """Yield the inertias behind a transmission that bends: they move otherwise than the drive."""
    for joint in chain.joints:
        behind = joint.output != driven and plant.position(joint.output)
        if joint.compliant and behind and driven in chain.axes[: chain.axes.index(joint.output)]:
            acceleration = plant.moved(joint.output, ACCELERATION)
            yield Part("inertia.missing", 1, {"acceleration": acceleration})


def _efforts(plant: Plant, chain: Chain) -> Iterator[Written]:
    """Yield the equations of what the drive and the transmissions of a chain lose."""
    reading = [(k, s) for k, axis in enumerate(chain.axes) if (s := plant.effort(axis)) is not None]
    driven = _driven(plant, chain.axes)
    drive = chain.actuator.name
    if not reading:
        weights = [
            Part("transmission.ratio", 1, {"load": load.name})
            for load in plant.loads
            if load.axis in chain.axes
        ]
        others = [_gain(one, -1) for one in chain.also]
        parts = (*weights, *_motion(plant, driven, driven, 1), *_swung(plant, chain, driven))
        if parts:
            yield Written(chain.actuator.axis, drive, (*others, *parts, OFFSET))
        return
    gains = [_gain(one, 1) for one in (chain.actuator, *chain.also)]
    at, first = reading[0]
    own = _driven(plant, chain.axes[: at + 1]) or driven
    losses = _motion(plant, own, own, -1)
    yield Written(chain.actuator.axis, first.name, (*gains, *losses, OFFSET))
    for (near, here), (far, there) in pairwise(reading):
        ratio = Part("transmission.ratio", 1, {"load": there.name})
        speed_of = _driven(plant, chain.axes[near : far + 1])
        parts = (ratio, *_motion(plant, speed_of, driven, 1), OFFSET)
        yield Written(chain.joints[far - 1].name, here.name, parts)


def _gain(drive: Actuator, sign: int) -> Part:
    """Return a drive times a gain."""
    if unit_of(drive.name) in EFFORT.values():
        return Part("transmission.ratio", sign, {"load": drive.name})
    return Part("motor.torque_constant", sign, {"source": drive.name})


def _deflections(plant: Plant, chain: Chain) -> Iterator[Written]:
    """Yield the equations of the bends of a chain's transmissions."""
    for joint in chain.joints:
        driving, driven = plant.position(joint.input), plant.position(joint.output)
        load = plant.effort(joint.output) or plant.effort(joint.input)
        bend = bend_channel(plant, joint)
        if not joint.compliant or load is None:
            continue
        sign = 1 if bend else -1
        parts = [Part("compliance.link", sign, {"load": load.name})]
        unit = unit_of(load.name)
        if joint.damped and unit in RATE:
            rate = load.name.removesuffix("_n_m") + RATE[unit]
            parts.append(Part("transmission.damping", -sign, {"rate": rate}))
        if bend is not None:
            target = bend.name
        elif driving is not None and driven is not None:
            target = driven.name
            parts.insert(0, Part("transmission.ratio", 1, {"load": driving.name}))
        else:
            continue
        yield Written(_bend_name(plant, joint), target, (*parts, OFFSET))


def missing(plant: Plant) -> Iterator[Missing]:
    """Yield the gaps of these sensors: quantities without an equation, and the sensor for each."""
    efforts = [sensor.name for sensor in plant.sensors if sensor.reads == "effort"]
    undriven = not plant.actuators and not equations(plant)
    if undriven and efforts:
        yield Missing(
            "No [[actuator]] drives the machine: no equation has an effort on its left.",
            "An [[actuator]] in place of the [[sensor]] that reads the driving effort, such as"
            f" {efforts[0]}.",
        )
    if undriven and not efforts:
        yield Missing(
            "Nothing drives the machine and no effort is read.",
            "An [[actuator]], or a [[sensor]] that reads an effort (N or N m).",
        )
    for chain in chains(plant):
        axes, drive = ", ".join(chain.axes), chain.actuator.name
        scale, kinds = unit_of(drive), [EFFORT[plant.axis(axis).unit] for axis in chain.axes]
        if scale not in EFFORT.values() and not any(plant.effort(axis) for axis in chain.axes):
            yield Missing(
                f"What {drive} drives with is known in {scale} only:"
                " inertia and friction come out in units of the drive.",
                f"A sensor of effort ({kinds[0]}) on one of {axes}."
                if len({*kinds}) == 1
                else "A sensor of effort on one of "
                + ", ".join(f"{a} ({k})" for a, k in zip(chain.axes, kinds, strict=True))
                + ".",
            )
        if not _driven(plant, chain.axes):
            yield Missing(
                f"No motion is measured behind {drive}: neither inertia nor"
                " friction can be identified.",
                f"A sensor of position or speed on one of {axes}.",
            )
    axis_of = {sensor.name: sensor.axis for sensor in plant.sensors}
    followed = positions.followers(plant)
    for position, speed in integrals(plant).items():
        if axis_of[speed] in followed:
            continue
        yield Missing(
            f"{position} is the integral of {speed} and begins at 0 in each run: what depends on"
            " it cannot be compared between runs.",
            f"A sensor of position on {axis_of[speed]}.",
        )
    read = positions.rigidly(plant)
    for joint in plant.transmissions:
        ends = (joint.input, joint.output)
        absent = [f"of position on {axis}" for axis in ends if axis not in read]
        if not any(plant.effort(axis) for axis in ends):
            absent.append(f"of effort on {joint.output} or {joint.input}")
        if joint.compliant and absent:
            yield Missing(
                f"The bend of {joint.name} cannot be identified.",
                f"A sensor {' and one '.join(absent)}.",
            )
    driven = {axis for chain in chains(plant) for axis in chain.axes}
    for axis in plant.axes:
        if axis.name not in driven and plant.actuators:
            yield Missing(
                f"Nothing drives the axis {axis.name}: no equation has it.",
                "An [[actuator]] on it, or a [[transmission]] that leads to it.",
            )


def unused(plant: Plant) -> list[str]:
    """Return the channels that no equation reads."""
    from estimation.derived import measured_channels  # loads numba, which help must not

    names = _read(plant)
    read = {*names, *measured_channels(names, signals(plant))}
    read |= {speed for position, speed in integrals(plant).items() if position in read}
    return [s.name for s in plant.sensors if s.name not in read]


def _read(plant: Plant) -> list[str]:
    """Return the channels that the equations name."""
    return [
        name
        for equation in equations(plant)
        for name in (equation.target, *(n for p in equation.parts for n in p.channels.values()))
    ]
