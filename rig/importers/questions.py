"""What may be wrong with the channels of recordings, as questions to who knows the machine.

`rig import --preview`, `rig machine check`, `rig fit` and `rig diagnose` ask the same ones, of
tables and of logs. Samples that are flagged do not count. Nothing is corrected here.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from estimation.campaign import Campaign
from estimation.channels import unit_of
from estimation.copies import copies
from estimation.errors import EstimationError
from estimation.fitting import fit
from estimation.opposed import opposed
from estimation.plant import Plant
from estimation.plant_check import contradictions
from estimation.plant_equations import integrals
from estimation.plant_models import declared
from estimation.recording import FloatArray, Recording
from estimation.turned import turned_runs
from estimation.zeros import moved_zeros
from rig.importers.apart import in_another_unit, of_another_sign
from rig.importers.clock import implausible_clocks
from rig.importers.frozen import COMMAND, frozen
from rig.importers.tachometers import of_speeds
from rig.output.table import counted

PLAUSIBLE: dict[str, tuple[float, str]] = {
    "rad": (200.0, "degrees or counts"),
    "rad/s": (2000.0, "degrees a second, revolutions a minute or counts"),
    "m": (20.0, "millimetres or counts"),
    "m/s": (50.0, "millimetres a second"),
    "N m": (2000.0, "millinewton metres or counts"),
    "N": (50000.0, "counts"),
    "A": (200.0, "milliamperes or counts"),
    "V": (1000.0, "millivolts or counts"),
    "1": (10.0, "per cent or counts"),
}
"""Size above which values of a bench machine are unusual, and what the column may be in instead.

The sizes are those of machines that fit a room: 32 turns of a shaft, 20000 revolutions a minute."""

MOST_LONE, FAR_OUT = 3, 10.0
"""Most values that are far beyond all others together, and how many times as far from the median
as any other value they are, or as large as any in other runs. A value may be that of many samples,
such as -9999 of no reading."""

COLDEST_K, HOTTEST_K = 200.0, 600.0

PLATEAU = 3
"""Equal samples in a row that make a plateau."""

ENTRY = 6
"""Samples before a plateau of which the largest step counts."""

CLIPPED = 0.005
"""Share of the samples on abrupt plateaus at an end of the range that is remarked on."""

ROUNDING = 1e-9
"""Share of its range by which values of a channel differ in their rounding alone."""

MOST_NAMED = 6
"""Most runs that a question about a channel names."""

WHOLE = 0.75
"""Share of its range that no position crosses between two samples while it moves."""


def questions(recordings: Sequence[Recording], plant: Plant | None = None) -> list[str]:
    """Return the doubts about the channels and zeros of runs: questions, each with its channel.

    The machine states what is in front of a gear, and which channels were not read but follow from
    others; nothing is asked about those.
    """
    derived = {} if plant is None else integrals(plant)
    names = dict.fromkeys(name for r in recordings for name in r.columns if name not in derived)
    limits = {} if plant is None else travels(plant)
    found = [
        f"{n}: {text}" for n in names for text in of_channel(n, recordings, limits.get(n, 0.0))
    ]
    speeds = () if plant is None else of_speeds(recordings, plant)
    return [*found, *speeds, *of_runs(without(recordings, derived))]


def without(recordings: Sequence[Recording], names: Collection[str]) -> list[Recording]:
    """Return recordings without some channels, such as those that follow from others."""
    return [
        replace(r, columns={n: v for n, v in r.columns.items() if n not in names})
        for r in recordings
    ]


def doubts(recordings: Sequence[Recording], plant: Plant | None) -> list[str]:
    """Return where runs contradict the file of their machine, if known, and the questions."""
    contradicted = () if plant is None else contradictions(plant, recordings)
    return [*contradicted, *questions(recordings, plant)]


def of_runs(recordings: Sequence[Recording]) -> Iterator[str]:
    """Yield the doubts about runs and their files, and about runs next to one another."""
    doubts = dict.fromkeys(doubt for r in recordings for doubt in r.doubts)
    for doubt in doubts:
        runs = [r.name for r in recordings if doubt in r.doubts]
        yield doubt if len(runs) == len(recordings) else f"{doubt} This is in {', '.join(runs)}."
    same: dict[str, list[str]] = {}
    for copy, first in copies(recordings).items():
        same.setdefault(first, []).append(copy)
    for first, names in same.items():
        yield (
            f"{', '.join((first, *names))}: these runs are the same, sample by sample, and count"
            " once; was a file copied?"
        )
    yield from implausible_clocks(recordings)
    read = _without_lone(recordings)
    yield from in_another_unit(read)
    yield from of_another_sign(read)
    yield from frozen(recordings)
    yield from (zero.sentence for zero in moved_zeros(recordings))


def of_equations(recordings: Sequence[Recording], plant: Plant) -> Iterator[str]:
    """Yield the runs in which a channel of a machine's equation has the opposite sign.

    A preview asks so; the commands that fit the equations do so themselves.
    """
    campaign = Campaign.of(recordings)
    found: list[str] = []
    for model in declared(plant):
        with suppress(EstimationError):
            fitted = fit(model, campaign, bootstrap=0)
            if not opposed(fitted, campaign):
                found += turned_runs(fitted, campaign)
    yield from dict.fromkeys(found)  # a channel is in several equations


def travels(plant: Plant) -> dict[str, float]:
    """Return the size above which each position is unusual: that of the slowest axis, geared up."""
    sizes = {axis.name: PLAUSIBLE[axis.unit][0] for axis in plant.axes}
    geared = [one for one in plant.transmissions if one.ratio]
    for one in geared * len(geared):  # in whichever order they are stated
        sizes[one.input] = max(sizes[one.input], abs(one.ratio or 1.0) * sizes[one.output])
    read = [sensor for sensor in plant.sensors if sensor.reads == "position"]
    return {sensor.name: sizes[sensor.axis] for sensor in read if sensor.axis in sizes}


def of_channel(name: str, recordings: Sequence[Recording], travel: float = 0.0) -> list[str]:
    """Return the doubts about a channel over all runs: questions.

    A position up to `travel` is not unusual, if that is more than without a gear.
    """
    parts = _parts(name, recordings)
    values = np.concatenate([part[np.isfinite(part)] for part in parts])
    if not values.size:
        return []
    unit = unit_of(name)
    lone, usual = _lone(values)
    wrong = [_outlier(name, unit, lone, usual, recordings)] if lone else []
    if lone:
        parts = [np.where(np.isin(part, lone), np.nan, part) for part in parts]
        values = np.concatenate([part[np.isfinite(part)] for part in parts])
    least, greatest = float(values.min()), float(values.max())
    runs = dict(zip((r.name for r in recordings if name in r), parts, strict=True))
    wrong += _implausible(unit, runs, least, greatest, travel)
    if least == greatest:
        if COMMAND.search(name):
            return wrong
        return [*wrong, f"it is constant at {with_unit(least, unit)}; is the sensor connected?"]
    wrong += _clipped(runs, least, greatest, unit)
    if unit in ("rad", "m"):
        wrong += _wrapped(parts, least, greatest, unit)
    return wrong


def _parts(name: str, recordings: Sequence[Recording]) -> list[FloatArray]:
    """Return a channel of the runs that have it, NaN where a sample is flagged."""
    return [np.where(r.valid, r[name], np.nan) for r in recordings if name in r]


def _lone(values: FloatArray) -> tuple[list[float], str]:
    """Return the few values far beyond all others, and how far these are, as a formula.

    There are none in a channel that is constant otherwise: they may be pulses.
    """
    median = float(np.median(values))
    values = np.unique(values)
    far = np.abs(values - median)
    order = np.argsort(far)[::-1]
    for count in range(min(MOST_LONE, len(values) - 1), 0, -1):
        least, rest = float(far[order[count - 1]]), float(far[order[count]])
        if rest > 0.0 and least > FAR_OUT * rest:
            limit = float(np.sqrt(least * rest))
            return values[order[:count]].tolist(), f"{median:.3g}) > {limit:.3g}"
    return [], ""


def _without_lone(recordings: Sequence[Recording]) -> list[Recording]:
    """Return the runs without the channels that hold values far beyond all others.

    Their size there is that of these values.
    """
    found = list(recordings)
    for name in dict.fromkeys(name for r in recordings for name in r.columns):
        values = np.concatenate([part[np.isfinite(part)] for part in _parts(name, recordings)])
        lone = _lone(values)[0] if values.size else []
        for k, run in enumerate(found) if lone else ():
            if name in run and np.isin(run[name], lone).any():
                found[k] = run.with_columns(**{name: np.full(len(run), np.nan)})
    return found


def _outlier(
    name: str, unit: str, lone: Sequence[float], usual: str, recordings: Sequence[Recording]
) -> str:
    """Return a question about samples far beyond all others, with their places and the remedy."""
    places = [
        (float(r[name][k]), f"{r.time_s[k]:.4g} s of {r.name}")
        for r in recordings
        if name in r
        for k in np.flatnonzero(np.isin(r[name], lone) & r.valid)
    ]
    if len(places) > MOST_LONE:
        values = " and ".join(with_unit(value, unit) for value in sorted(lone))
        shown = f"exactly {values}, from {places[0][1]} to {places[-1][1]}"
        asked, reason = "does that mean that nothing was read", "no reading"
    else:
        shown = ", ".join(f"{with_unit(value, unit)} at {place}" for value, place in places)
        asked, reason = "was it so", "spike"
    answer = "If so" if len(places) > MOST_LONE else "If not"
    return (
        f"{counted(len(places), 'sample')} far beyond all others, {shown}; {asked}?"
        f" {answer}, flag it: [[data.invalid]] with when = 'abs({name} - {usual}',"
        f" reason = '{reason}', missing = true"
    )


def _implausible(
    unit: str, runs: Mapping[str, FloatArray], least: float, greatest: float, travel: float
) -> Iterator[str]:
    if unit == "K":
        if least < COLDEST_K or greatest > HOTTEST_K:
            yield f"{least:g} to {greatest:g} K is unusual; is the column in degC?"
    elif unit in PLAUSIBLE:
        limit, instead = PLAUSIBLE[unit]
        size = max(abs(least), abs(greatest))
        if size > max(limit, travel):
            turns = f", {size / (2 * np.pi):.0f} turns," if unit == "rad" else ""
            large = f"{with_unit(size, unit)}{turns} is unusually large"
            if apart := _far_larger(runs, max(limit, travel)):
                yield (
                    f"{large} in {_listed(apart)}, and the other runs are not; is the column in"
                    f" {instead} there? A unit of [data] is that of all files: correct these"
                    " files, or import them by themselves with a unit of their own."
                )
            else:
                yield f"{large}; is the column in {instead}?"


def _far_larger(runs: Mapping[str, FloatArray], limit: float) -> list[str]:
    """Return the runs beyond a limit, if all others are far smaller than each; none without any."""
    sizes = {n: float(np.abs(x[np.isfinite(x)]).max(initial=0.0)) for n, x in runs.items()}
    apart = [name for name, size in sizes.items() if size > limit]
    rest = [size for name, size in sizes.items() if name not in apart]
    is_far = bool(rest) and min(sizes[name] for name in apart) > FAR_OUT * max(rest)
    return apart if is_far else []


def _listed(names: Sequence[str]) -> str:
    """Return the names of runs, of many the first ones."""
    shown = ", ".join(names[:MOST_NAMED])
    more = len(names) - MOST_NAMED
    return shown if more <= 0 else f"{shown} and {counted(more, 'other run')}"


def _clipped(
    runs: Mapping[str, FloatArray], least: float, greatest: float, unit: str
) -> Iterator[str]:
    """Yield the ends of the range that are reached abruptly and held: a limit, not a standstill."""
    parts = [*runs.values()]
    steps = np.concatenate([np.abs(np.diff(part)) for part in parts])
    moving = steps[steps > 0]
    usual = float(np.median(moving)) if moving.size else 0.0
    values = np.concatenate(parts)
    levels = np.unique(values[np.isfinite(values)])
    if len(levels) <= PLATEAU:  # a switch
        return
    apart = np.diff(levels)
    count = float(apart[apart > ROUNDING * (greatest - least)].min())
    abrupt = max(usual / 2, 1.5 * count)  # a slow reading in whole counts moves by one of them
    for end, word in ((least, "least"), (greatest, "greatest")):
        held = {name: _held(part, end, abrupt) for name, part in runs.items()}
        share = sum(held.values()) / len(values)
        if share > CLIPPED:
            places = [name for name, count in held.items() if count]
            where = f" in {_listed(places)}" if len(places) < len(runs) else ""
            yield (
                f"{100 * share:.1f} % of the samples are held at the {word} value,"
                f" {with_unit(end, unit)}{where}; is it clipped?"
            )


def _held(values: FloatArray, end: float, abrupt: float) -> int:
    """Return the samples on plateaus at a value that are entered by a step of at least this."""
    at = np.flatnonzero(np.diff(np.concatenate([[False], values == end, [False]])))
    held = 0
    for first, stop in at.reshape(-1, 2):
        if stop - first >= PLATEAU and first >= 2:
            # without the last step, which the limit itself cuts short; by noise, one may be small
            entered = float(np.abs(np.diff(values[max(first - ENTRY, 0) : first])).max())
            held += int(stop - first) if entered >= abrupt and entered > 0 else 0
    return held


def with_unit(value: float, unit: str) -> str:
    """Return a value with its unit; a ratio has none."""
    return f"{value:.4g}" if unit == "1" else f"{value:.4g} {unit}"


def _wrapped(
    parts: Sequence[FloatArray], least: float, greatest: float, unit: str
) -> Iterator[str]:
    """Yield that a position in motion jumps from one end of its range to the other."""
    turns: list[float] = []
    for part in parts:
        steps = np.diff(part[np.diff(part, prepend=np.nan) != 0])
        before, step, after = steps[:-2], steps[1:-1], steps[2:]
        onward = (before * step < 0) & (after * step < 0)
        small = np.maximum(np.abs(before), np.abs(after)) < 0.5 * np.abs(step)
        there = onward & small & (np.abs(step) > WHOLE * (greatest - least))
        turns += (np.abs(step) + (np.abs(before) + np.abs(after)) / 2)[there].tolist()
    if turns:
        yield (
            f"it jumps by its whole range {len(turns)} times in motion; does its counter start"
            f" again every {with_unit(float(np.median(turns)), unit)}? wraps_at states that range"
            " in the unit of the column"
        )
