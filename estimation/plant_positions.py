"""The position of every axis: its encoder's, its neighbour's over their ratio, or an integral.

An axis without an encoder has the position that a transmission of known ratio gives it. Only where
there is none is its speed integrated: an integral drifts and begins at 0 in each run.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

from estimation.plant import ACCELERATION, POSITION, SPEED, Plant, Transmission
from estimation.signals import Combination, Share

BY_SPEED = "_by_speed"
"""Part of the name of the integral of a speed whose axis has a better position."""


def joined(plant: Plant) -> tuple[Combination, ...]:
    """Return the positions that follow from another axis' by the ratio of a transmission.

    A shaft that a gear drives turns by the motor's angle over the ratio, but for the gear's bend.
    The other way round the bend would count as many times as the ratio.
    """
    shares = _encoders(plant)
    found = _along(plant.transmissions, plant, shares)
    for axis in plant.axes:
        if axis.name not in shares and plant.speed(axis.name) is not None:
            shares[axis.name] = Share(plant.moved(axis.name, POSITION))
    known = {c.name for c in found}
    return (*found, *(c for c in _along(plant.transmissions, plant, shares) if c.name not in known))


def followers(plant: Plant) -> set[str]:
    """Return the axes without an encoder whose position follows from one that has one."""
    shares = _encoders(plant)
    read = {*shares}
    _along(plant.transmissions, plant, shares)
    return {*shares} - read


def integrals(plant: Plant, read: Collection[str]) -> dict[str, str]:
    """Return the positions that are integrals of a measured speed, to that speed.

    Args:
        plant: The machine.
        read: Channels that its equations read. The speed of an axis whose position follows from
            another's has an integral of its own only where they read that speed: a speed comes
            from a position.
    """
    found, follow = {}, followers(plant)
    for axis in plant.axes:
        speed = plant.speed(axis.name)
        if speed is None or plant.position(axis.name) is not None:
            continue
        if axis.name not in follow:
            found[plant.moved(axis.name, POSITION)] = speed.name
        elif {plant.moved(axis.name, rate) for rate in (SPEED, ACCELERATION)}.intersection(read):
            stem = speed.name.removesuffix(SPEED[axis.unit]) + BY_SPEED
            found[stem + POSITION[axis.unit]] = speed.name
    return found


def speeds(plant: Plant, integrated: Mapping[str, str]) -> tuple[Combination, ...]:
    """Return the speeds and accelerations that a sensor reads better than a neighbour's encoder.

    Args:
        plant: The machine.
        integrated: Its positions that are integrals of a measured speed.
    """
    axis_of = {sensor.name: sensor.axis for sensor in plant.sensors}
    return tuple(
        Combination(
            plant.moved(axis, rate), (Share(position.removesuffix(POSITION[unit]) + rate[unit]),)
        )
        for position, speed in integrated.items()
        if position != plant.moved(axis := axis_of[speed], POSITION)
        for unit in [plant.axis(axis).unit]
        for rate in (SPEED, ACCELERATION)
    )


def rigidly(plant: Plant) -> dict[str, Share]:
    """Return the axes with an encoder, or with one a rigid transmission away, to their position."""
    shares = _encoders(plant)
    _along([joint for joint in plant.transmissions if not joint.compliant], plant, shares)
    return shares


def _encoders(plant: Plant) -> dict[str, Share]:
    """Return the axes with a sensor of position, to that position."""
    read = {axis.name: plant.position(axis.name) for axis in plant.axes}
    return {axis: Share(sensor.name) for axis, sensor in read.items() if sensor is not None}


def _along(
    joints: Sequence[Transmission], plant: Plant, shares: dict[str, Share]
) -> list[Combination]:
    """Return the positions that transmissions give from those of axes; add their axes to these."""
    found: dict[str, Combination] = {}
    for joint in [*joints] * len(joints):  # along a chain of any order
        ways = [(joint.input, joint.output, joint.ratio)]
        if joint.ratio and not joint.compliant:
            ways.append((joint.output, joint.input, 1.0 / joint.ratio))
        for near, far, ratio in ways:
            if not ratio or near not in shares:
                continue
            share = replace(shares[near], over=shares[near].over * ratio)
            name = plant.moved(far, POSITION) or far + POSITION[plant.axis(far).unit]
            if name not in (share.channel, *found):
                shares.setdefault(far, share)
                found[name] = Combination(name, (share,))
    return [*found.values()]
