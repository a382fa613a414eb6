"""A preview of a table before it is imported: ranges, rates, and what may be wrong.

Each remark is a question to the person who knows the machine; nothing is corrected here.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from estimation.channels import unit_of
from estimation.plant import Plant
from estimation.recording import FloatArray, Recording
from rig.importers.derivatives import fault, pairs
from rig.importers.questions import of_channel, of_equations, of_runs, travels
from rig.importers.table.raw import Remark
from rig.importers.tachometers import of_speeds
from rig.output.table import counted

GAP_PERIODS = 1.5
"""Step of time, in median steps, from which samples are missing between two; as for derivatives."""

JITTER = 0.2
"""Median deviation of the steps of time, in median steps, that is remarked on."""

LEAST_STEP = 0.5
"""Step of time, in median steps, below which no filter counts a period: it rounds to none."""

FAR = 10.0
"""Deviations of a step of time from the median beyond which no jitter reaches."""

LONG_PERIODS = 20.0
"""Step of time, in median steps, from which a gap is a pause between runs, not lost samples."""

NUMBER = re.compile(r"(?<![\w.])\d[\d.]*(e[-+]?\d+)?(?!\w)")
"""A number in a sentence; not one in the name of a channel."""

ROWS = 5
"""Samples shown of the first run."""


@dataclass(frozen=True)
class ChannelView:
    """One channel over all runs.

    `wrong` is what may be wrong with it, in words.
    """

    name: str
    unit: str
    least: float
    greatest: float
    mean: float
    wrong: tuple[str, ...]


@dataclass(frozen=True)
class RunView:
    """One run: its length, rate, conditions, flagged samples, and what may be wrong with its clock.

    `rate_hz` is None for a run of one sample.
    """

    name: str
    samples: int
    duration_s: float
    rate_hz: float | None
    flagged: int
    conditions: dict[str, float | str]
    wrong: tuple[str, ...]


@dataclass(frozen=True)
class Preview:
    """A look at a table."""

    runs: tuple[RunView, ...]
    channels: tuple[ChannelView, ...]
    first: dict[str, list[float]]  # channel and time to the values of the first samples
    wrong: tuple[str, ...]  # what may be wrong with channels together, in words
    remarks: tuple[str, ...]  # what was assumed, left out or filled in, in words

    @property
    def questions(self) -> list[str]:
        """Everything that may be wrong, in words, each with the channel or run it is about."""
        found = [f"{c.name}: {text}" for c in self.channels for text in c.wrong]
        of_runs = [(r.name, text) for r in self.runs for text in r.wrong]
        return [*found, *_grouped(of_runs, "runs"), *self.wrong]


def preview(
    recordings: Sequence[Recording], remarks: Sequence[Remark], plant: Plant | None = None
) -> Preview:
    """Return a look at the runs of a table, at least one, and at the first rows of the first run.

    The runs are not yet checked against their derivatives; `remarks` is what reading them remarked.
    The machine, if known, states what is in front of a gear, and the equations of the channels.
    """
    names = list(dict.fromkeys(name for r in recordings for name in r.columns))
    limits = {} if plant is None else travels(plant)
    first = recordings[0]
    shown = {n: np.asarray(first[n])[:ROWS].tolist() for n in ("time_s", *first.columns)}
    together = [
        (r.name, wrong) for r in recordings for pair in pairs(r) if (wrong := fault(r, *pair))
    ]
    of_plant = (
        () if plant is None else (*of_speeds(recordings, plant), *of_equations(recordings, plant))
    )
    return Preview(
        tuple(_run(recording) for recording in recordings),
        tuple(_channel(name, recordings, limits.get(name, 0.0)) for name in names),
        shown,
        (*_grouped(together, "runs"), *of_runs(recordings), *of_plant),
        tuple(_grouped(remarks, "files")),
    )


def _grouped(remarks: Sequence[Remark], noun: str) -> Iterator[str]:
    """Yield remarks with the file or run each is about; the same on several once.

    Those that differ in their numbers alone are the same.
    """
    about: dict[str, list[Remark]] = {}
    for place, text in remarks:
        about.setdefault(NUMBER.sub("", text), []).append((place, text))
    for same in about.values():
        place, text = same[0]
        if len(same) == 1:
            yield f"{place}: {text}"
        elif len({one for _, one in same}) == 1:
            yield f"{text} ({len(same)} {noun})"
        else:
            yield f"{place}: {text} ({counted(len(same) - 1, 'other')} alike)"


def _run(recording: Recording) -> RunView:
    rate_hz = recording.sample_rate_hz if len(recording) > 1 else None
    return RunView(
        recording.name,
        len(recording),
        recording.duration_s,
        rate_hz,
        int((~recording.valid).sum()),
        dict(recording.conditions),
        tuple(_clock(recording.time_s)),
    )


def _clock(time_s: FloatArray) -> Iterator[str]:
    steps = np.diff(time_s)
    if len(steps) < 2:
        return
    usual = float(np.median(steps))
    spread = float(np.median(np.abs(steps - usual))) / usual
    gaps = steps[steps > (GAP_PERIODS + FAR * spread) * usual]
    pauses, lost = gaps[gaps > LONG_PERIODS * usual], gaps[gaps <= LONG_PERIODS * usual]
    rate_hz = float(f"{1 / usual:.3g}")
    even = f"even_rate_hz = {rate_hz:g} under [data] interpolates"
    if pauses.size:
        yield (
            f"{counted(pauses.size, 'gap')} in time, the longest of {float(pauses.max()):.4g} s;"
            " gap_s under [data.runs] cuts runs there"
        )
    if spread > JITTER or float(steps.min()) <= LEAST_STEP * usual:
        rest = steps[steps <= LONG_PERIODS * usual]
        yield (
            f"the steps of time are between {1e3 * float(rest.min()):.3g} and"
            f" {1e3 * float(rest.max()):.3g} ms, {1e3 * usual:.3g} ms is usual; {even} onto an even"
            " clock"
        )
    elif lost.size:
        yield (
            f"{counted(lost.size, 'short gap')} in time, the longest of {float(lost.max()):.4g} s;"
            f" {even} over lost samples"
        )


def _channel(name: str, recordings: Sequence[Recording], travel: float) -> ChannelView:
    values = np.concatenate([r[name] for r in recordings if name in r])
    values = values[np.isfinite(values)]
    least, greatest, mean = (float(f(values)) for f in (np.min, np.max, np.mean))
    wrong = tuple(of_channel(name, recordings, travel))
    return ChannelView(name, unit_of(name), least, greatest, mean, wrong)
