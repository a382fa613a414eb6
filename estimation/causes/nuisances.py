"""What is part of every regression and no finding: short delays of readings, and noisy bands."""

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from estimation.causes.candidates import Candidate, Claim, groups_of, without_declared
from estimation.causes.folds import Folds
from estimation.causes.instruments import above, noisy_bands
from estimation.causes.joint import Joint
from estimation.causes.offered import sources_at
from estimation.causes.places import places_of
from estimation.causes.scoring import assessed
from estimation.causes.sources import Source
from estimation.effects import effect

SKEW_S = 1e-3
MOST_SKEW = 2.0
"""Usual delay of a reading against the others, a sample at 1 kHz, and the most, over it."""


def skews(joint: Joint) -> list[Claim]:
    """Return the readings that are late or early by a little, each as a short delay.

    No two boards share a clock, and a reading has an age. A delay as short as that is part of the
    base, no finding; a longer one is, and so is none that is short only because it stands in for a
    longer one of another reading. Where a reading is differentiated its noise hides as short a
    delay.
    """
    plain = [
        replace(place, enters=tuple(e for e in place.enters if e.order == 0))
        for place in places_of(joint.layout)
    ]
    late = [
        Claim(replace(source, shape=(SKEW_S,)))
        for place in plain
        if place.enters
        for source in itertools.islice(sources_at(joint.layout, place, [effect("sensor.delay")]), 1)
    ]
    every = sum(claim.cause.place.kind == "angle sensor" for claim in late)
    while True:
        found = [one for group in groups_of(joint, late) for one in group.candidates]
        delays = _with_delays(joint, found).left_out([[]]).base[0][joint.size :]
        sizes = np.array([d / one.size[0] for d, one in zip(delays, found, strict=True)])
        angles = np.array([one.cause.place.kind == "angle sensor" for one in found], dtype=bool)
        if 1 < angles.sum() == every:  # only differences are measured, and no reading is early
            sizes[angles] -= sizes[angles].min()
        late = [Claim(one.cause) for one, x in zip(found, sizes, strict=True) if abs(x) < MOST_SKEW]
        if len(late) == len(found):
            return late


def noticed(
    joint: Joint, late: Sequence[Claim], causes: Sequence[Candidate], folds: Folds
) -> dict[str, float]:
    """Return the angles whose short delay next to causes is worth a cause's price, and it, s.

    Of angles only differences are measured: each is judged without the delays of the others.
    """
    others = [one for one in late if one.cause.place.kind != "angle sensor"]
    if len(late) - len(others) < 2:
        return {}
    base = with_skews(joint, others)
    for one in causes:
        base = base.with_cause(one.laid, one.precision)
    found = {}
    for claim in late:
        if claim in others or not isinstance(claim.cause, Source):
            continue
        times = [replace(claim.cause, shape=(share * SKEW_S,)) for share in (0.25, 0.5, 1.0, 2.0)]
        scored = assessed(base, groups_of(base, [Claim(one) for one in times]), folds)
        best = max(scored, key=lambda s: s.score, default=None)
        if best is not None and best.score > 0.0 and isinstance(best.candidate.cause, Source):
            (delay_s,) = best.candidate.cause.shape
            size = float(best.amplitudes[0] / best.candidate.size[0])
            found[claim.cause.place.name.removeprefix("sensor ")] = size * delay_s
    return found


def with_skews(joint: Joint, late: Sequence[Claim]) -> Joint:
    """Return a regression with short delays and noisy bands of readings in its base."""
    return _with_delays(_with_bands(joint), late)


def _with_bands(joint: Joint) -> Joint:
    """Return a regression in which the noisy bands of a channel have amplitudes of their own.

    With one amplitude a noisy channel's parameter comes out too small, and the same channel with
    less noise, such as by a lag of its sensor, passes for a cause.
    """
    layout = joint.layout
    for equation in layout.equations.values():
        bands = noisy_bands(equation, layout.runs)
        if bands:
            columns, shaken = (
                [{equation.name: above(equation, run, bands)} for run in runs]
                for runs in (layout.runs, layout.shaken)
            )
            laid = without_declared(joint, [columns], [shaken] if shaken else [], "each")
            joint = joint.with_cause(laid, np.full(len(bands), 4.0 / joint.power))
    return joint


def _with_delays(joint: Joint, late: Sequence[Claim]) -> Joint:
    for group in groups_of(joint, late):
        for one in group.candidates:
            joint = joint.with_cause(one.laid, 1.0 / one.size**2)
    return joint
