"""Building one case: a rig that works, and effects as strong as its kind asks for."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from benchmarks.rigs import equivalent, kernel, structure
from benchmarks.rigs.drawn import Drawn, Ranges, ranges_of
from benchmarks.rigs.plant import draw_controller, draw_plant, over
from benchmarks.rigs.protocol import draw_protocol
from benchmarks.rigs.recipes import RECIPES, STRENGTHS, needs_rest
from benchmarks.rigs.residual import EQUATIONS
from benchmarks.rigs.sensors import Fault, draw_chain
from benchmarks.rigs.stage import EPOCH_NS, FIRST, Stage, Switched, UnstableError
from benchmarks.rigs.strength import Fits, amplitude_for, fits_of, shown
from benchmarks.rigs.structure import HiddenTruth, Truth
from estimation.campaign import with_campaign_time
from rig.simulation.forms import Random

TRIED_RUNS = 5
DRAWS = 2
"""Draws of an effect's form on one rig before another rig is drawn."""

WORST_TRACKING = 0.4
"""A rig follows when its error is below this share of what it is asked for, both rms."""

INADEQUATE = 0.02
"""Largest noise-free residual of the declared equations, share of the noise's power: with more, a
rig without effects has one that is not declared, such as the damping of its cable."""

LATE = 0.02
"""Most that lags and skewed clocks may add to a clean residual's power, as a share of it."""

MOST_TOGETHER = 5
"""Most families that a confounded case may have: with more, the protocol shows nothing."""

INCOMPLETE = 1.15
"""Largest residual of the true structure over that without effects: else the effects make
the rig move as no equation of its parts follows, for example in a limit cycle."""

Built = tuple[Stage, tuple[Switched, ...], Truth]


def build(
    seed: int,
    kind: str,
    random: Random,
    names: Sequence[str],
    load: str | None,
    ratio: float | None,
) -> Built | None:
    """Draw a rig and hide effects in it; None where it does not work.

    The seed is of the noise; load and gear ratio are drawn where they are None.
    """
    plant = draw_plant(random, ratio)
    controller = draw_controller(random, plant)
    rests = True if any(map(needs_rest, names)) else None
    protocol, plans = draw_protocol(random, plant, load, rests)
    stage = Stage(plant, controller, protocol, plans, draw_chain(random, plant), seed)
    some = spread_over(stage.every, TRIED_RUNS)
    try:
        if not _follows(stage, some) or not _holds(stage, some[:3]):
            return None
        stage = _on_time(stage, some[:3])
        if not _follows(stage, stage.every) or not _holds(stage, stage.every):
            return None
        true = [stage.moved(k).true[FIRST:] for k in stage.every]
        ranges = ranges_of(plant, true, [plan.start_s for plan in plans])
        switched = []
        for name in names:
            one = _hidden(stage, kind, name, random, ranges)
            if one is None:
                return None
            switched.append(one)
        truth = _truth(stage, kind, names, switched)
    except UnstableError:
        return None
    stage.forget()
    return None if truth is None else (stage, tuple(switched), truth)


def spread_over(places: Sequence[int], count: int) -> tuple[int, ...]:
    """Return at most so many of some places, evenly spread."""
    at = np.unique(np.linspace(0, len(places) - 1, min(count, len(places))).round().astype(int))
    return tuple(places[int(k)] for k in at)


def _follows(stage: Stage, runs: Sequence[int]) -> bool:
    """Whether the rig does what it is asked for."""
    for k in runs:
        asked = stage.plans[k].setpoints[FIRST:, 0]
        error = stage.moved(k).true[FIRST:, kernel.SPINDLE_ANGLE] - asked
        if np.std(error) > WORST_TRACKING * np.std(asked):
            return False
    return True


def _holds(stage: Stage, runs: Sequence[int]) -> bool:
    """Whether the declared equations hold without effects, to well below the noise."""
    noisy = replace(stage, chain=stage.chain.on_time)
    usual, silent = fits_of(noisy.prepared(runs)), fits_of(noisy.prepared(runs, silent=True))
    return all(silent[e].rms() ** 2 < INADEQUATE * usual[e].rms() ** 2 for e in EQUATIONS)


def _on_time(stage: Stage, runs: Sequence[int]) -> Stage:
    """Return the rig with lags and skews so small that they barely show in a clean residual."""
    usual = fits_of(replace(stage, chain=stage.chain.on_time).prepared(runs))
    for share in (1.0, 0.5, 0.25, 0.12, 0.06):
        late = replace(stage, chain=stage.chain.hastened(share))
        fits = fits_of(late.prepared(runs))
        if all(fits[e].rms() ** 2 < (1.0 + LATE) * usual[e].rms() ** 2 for e in EQUATIONS):
            return late
    return replace(stage, chain=stage.chain.on_time)


def _runs_with(stage: Stage, kind: str, random: Random) -> tuple[int, ...]:
    """Return the places of the runs that have an effect."""
    if kind != "some_runs":
        return stage.every
    count = int(np.clip(round(random.uniform(0.3, 0.6) * len(stage.every)), 3, None))
    if random.random() < 0.5:
        return stage.every[-count:]
    return tuple(sorted(int(k) for k in random.choice(len(stage.every), count, replace=False)))


def _hidden(stage: Stage, kind: str, name: str, random: Random, ranges: Ranges) -> Switched | None:
    """Draw an effect and give it its strength; None where no draw comes out as strong."""
    low, high = STRENGTHS[kind]
    runs = _runs_with(stage, kind, random)
    beside = [k for k in stage.every if k not in runs]
    tried = tuple(sorted({*spread_over(runs, TRIED_RUNS), *spread_over(beside, 3)}))
    for _ in range(DRAWS):
        drawn = RECIPES[name](random, ranges)
        wanted = over(random, 1.2 * low, 0.85 * high) if low > 2 else over(random, 1.35, 1.75)
        start = Switched(drawn, 0.1 * drawn.guess, runs)
        found = amplitude_for(stage, start, wanted, tried, largest(drawn, stage))
        if found is not None:
            return found
    return None


def largest(drawn: Drawn, stage: Stage) -> float:
    """Return the largest amplitude at which a part is still a spring, a lever or a sensor."""
    part = drawn.part
    if isinstance(part, Fault):
        return {"delay": 0.08, "lag": 0.08, "creep": 0.6, "function": 10.0 * drawn.guess}[part.kind]
    table = part.tables[0]
    if part.place == "constant":
        return 0.6 / float(np.max(np.abs(table.values)))
    if part.operator == "lags":
        return 0.7
    if part.place == "pulley":
        return 0.5 * stage.plant.pull / table.steepest()
    if part.place in ("gear", "cable") and part.operator == "table" and not part.similar:
        own = table.variable != "spindle_angle"
        return 0.7 / table.steepest() if own else 10.0 * drawn.guess
    return 6.0 * drawn.guess


def _truth(
    stage: Stage, kind: str, names: Sequence[str], switched: Sequence[Switched]
) -> Truth | None:
    """Return the answer; None where an effect came out of its kind's strength on all runs."""
    clean = fits_of(stage.prepared(stage.every))
    prepared = stage.prepared(stage.every, switched) if switched else []
    whole = fits_of(prepared) if switched else clean
    found = []
    for name, one in zip(names, switched, strict=True):
        alone = whole if len(switched) == 1 else fits_of(stage.prepared(stage.every, [one]))
        strength, equation = shown(alone, clean, one.runs)
        low, high = STRENGTHS[kind]
        if not low <= strength <= high:
            return None
        drawn = one.drawn
        found.append(
            HiddenTruth(
                drawn.place, drawn.family, drawn.variables, one.runs, strength, equation, name,
                one.amplitude, drawn.synonyms,
            )
        )  # fmt: skip
    columns = structure.columns(stage, switched, clean)
    best = structure.oracle(prepared, columns, whole) if switched else clean
    if any(best[e].rms() > INCOMPLETE * clean[e].rms() for e in EQUATIONS):
        return None
    together: tuple[str, ...] = ()
    if kind == "confounded":
        together = _together(stage, switched, columns, clean)
        if not 2 <= len(together) <= MOST_TOGETHER:
            return None
    return Truth(
        tuple(found),
        {e: clean[e].rms() for e in EQUATIONS},
        {e: whole[e].rms() for e in EQUATIONS},
        {e: best[e].rms() for e in EQUATIONS},
        columns,
        together,
    )


def _together(
    stage: Stage,
    switched: Sequence[Switched],
    columns: structure.Columns,
    clean: Fits,
) -> tuple[str, ...]:
    """Return the families that reproduce the effects on these runs."""
    without = [with_campaign_time(stage.record(k, silent=True), EPOCH_NS) for k in stage.every]
    twin = stage.prepared(stage.every, silent=True)
    runs = stage.prepared(stage.every, switched, silent=True)
    known = [f for one in switched for f in (one.drawn.family, *one.drawn.synonyms)]
    return equivalent.reproducing(without, twin, runs, columns, clean, known)
