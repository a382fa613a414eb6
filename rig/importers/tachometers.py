"""Sensors of speed that contradict the encoder of their axis, or of another axis over the ratio.

A speed and a position of one name are compared where a file is read, see
`rig.importers.derivatives`. The others are the machine's to relate.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

from estimation.plant import POSITION, Plant
from estimation.plant_positions import joined
from estimation.recording import Recording
from estimation.signals import Combination, Share
from rig.importers.derivatives import Relation, relation


def of_speeds(recordings: Sequence[Recording], plant: Plant) -> Iterator[str]:
    """Yield the sensors of speed that an encoder contradicts, and in which runs: questions."""
    for speed, position in _positions(plant):
        (share,) = position.shares
        found = {
            run.name: one
            for run in recordings
            if speed in run and share.channel in run
            and (one := _relation(run, speed, share)) is not None
        }  # fmt: skip
        off = {name: one for name, one in found.items() if _is_off(one)}
        if not off:
            continue
        sizes = sorted(1.0 / one.ratio for one in off.values())
        is_whole = len(off) == len(recordings)
        where = "every run" if is_whole else ", ".join(off)
        source = share.channel if share.gain == 1.0 else f"{share.channel} times {share.gain:.4g}"
        yield (
            f"{speed}: it is {sizes[len(sizes) // 2]:.3g} times the speed of {source} in {where};"
            f" are its unit, gain and sign{', and the ratio,' * (is_whole and share.gain != 1.0)}"
            " right there?"
        )


def _positions(plant: Plant) -> Iterator[tuple[str, Combination]]:
    """Yield each sensor of speed and the position of its axis by an encoder of another name.

    A transmission that bends moves its ends apart: it is not compared over.
    """
    rigid = replace(plant, transmissions=tuple(t for t in plant.transmissions if not t.compliant))
    encoders = {s.name for s in plant.sensors if s.reads == "position"}
    follow = {c.name: c for c in joined(rigid) if c.shares[0].channel in encoders}
    for sensor in plant.sensors:
        if sensor.reads != "speed":
            continue
        if (own := plant.position(sensor.axis)) is not None:
            follows = Combination(own.name, (Share(own.name),))
        elif (name := rigid.moved(sensor.axis, POSITION)) in follow:
            follows = follow[name]
        else:
            continue
        yield sensor.name, follows


def _relation(recording: Recording, speed: str, share: Share) -> Relation | None:
    """Return how the position's slope, by its share, compares with a measured speed."""
    moved = recording.with_columns(**{share.channel: share.gain * recording[share.channel]})
    return relation(moved, share.channel, speed)


def _is_off(found: Relation) -> bool:
    return found.ratio < 0.0 or not found.allows(1.0)
