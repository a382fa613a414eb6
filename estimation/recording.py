"""A recording: one run as columns of float64 in SI units, with flags and what was known about it.

The run is the unit of evidence everywhere in this project, so a recording is immutable: columns are
read-only arrays, and every change makes a new recording that shares the columns it did not touch.
"""

import difflib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from enum import IntFlag
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike, NDArray

from estimation.channels import unit_of
from estimation.errors import EstimationError

FloatArray = NDArray[np.float64]

UNDATED_NS = 365 * 86_400 * 10**9
"""Start of a run below which it is the time of a recorder's clock, not a date."""


class Flag(IntFlag):
    """Faults of one sample; 0 is a valid sample."""

    VALID = 0
    SATURATED = 1  # a sensor or converter at its limit
    STALE = 2  # a value held over from an earlier tick
    MISSING = 4  # nothing was received for this tick
    SUSPECT = 8  # measured, but not by a rig working as intended (runaway, re-index)


@dataclass(frozen=True, slots=True)
class Stretch:
    """A flagged segment of a run.

    Attributes:
        start_s: Time of the first flagged sample, s.
        stop_s: Time of the last flagged sample, s.
        reason: Reason, in words that a person can act on.
        channel: The channel concerned, or None for all of them.
    """

    start_s: float
    stop_s: float
    flag: Flag
    reason: str
    channel: str | None = None


@dataclass(frozen=True, slots=True)
class Mark:
    """An operator's mark: a time in the run (s) and what happened."""

    time_s: float
    text: str


@dataclass(frozen=True, slots=True)
class Instrument:
    """Identity of the instrument under test. What is not known is None.

    After remounting, friction and zero differ, so `mounting` identifies the mounting.
    """

    model: str | None = None
    serial: str | None = None
    lot: str | None = None
    side: str | None = None
    uses: int | None = None
    mounting: str | None = None


OTHER = "Name a model or a machine file of these recordings, with --model or --machine."
"""What to do where recordings have no channel of a similar name."""


class MissingChannelError(EstimationError):
    """A recording lacks a channel that the work needs."""


class RecordingError(EstimationError):
    """Columns, flags or times do not make one recording."""


def read_only(values: ArrayLike) -> FloatArray:
    """Return values as a contiguous float64 array that cannot be written to.

    A writable array is copied, since its owner could change it later; hand over an array whose
    `flags.writeable` is already False to share it.
    """
    array = np.asarray(values, dtype=np.float64)
    if array.flags.writeable or not array.flags.c_contiguous:
        array = array.copy()
        array.flags.writeable = False
    return array


@dataclass(frozen=True, eq=False)
class Recording:
    """One run of the rig.

    Attributes:
        name: Name of the run, unique in its campaign.
        time_s: Device clock, shape (n,), strictly increasing.
        columns: Channel name to values, each of shape (n,), SI units.
        flags: Per-sample `Flag` bits, shape (n,), uint8.
        conditions: Constant conditions, numbers in SI with the unit in the name
            (`load_command_a`, `frequency_hz`) or words.
        stretches: Flagged segments with their reasons.
        started_at_ns: Start of the run, ns since the Unix epoch, or below `UNDATED_NS` since the
            zero of a clock that all runs share and that has no date; None when not recorded.
        calibrations: Calibration name to content hash.
        source: File it was read from.
        excluded: Reason for excluding the run, or None when it counts.
        is_simulated: Whether it was recorded on a simulated rig, as far as its file states that.
        doubts: What is doubtful about its file, questions in words. A log does not keep them.
    """

    name: str
    time_s: FloatArray
    columns: Mapping[str, FloatArray]
    flags: NDArray[np.uint8] = field(default_factory=lambda: np.empty(0, np.uint8))
    conditions: Mapping[str, float | str] = field(default_factory=dict)
    rig: str = ""
    instrument: Instrument = field(default_factory=Instrument)
    notes: str = ""
    marks: tuple[Mark, ...] = ()
    stretches: tuple[Stretch, ...] = ()
    started_at_ns: int | None = None
    calibrations: Mapping[str, str] = field(default_factory=dict)
    source: str = ""
    excluded: str | None = None
    is_simulated: bool = False
    doubts: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        time_s = read_only(self.time_s)
        if time_s.ndim != 1:
            raise RecordingError(f"Run {self.name!r}: time_s has shape {time_s.shape}, not (n,).")
        if not np.all(np.isfinite(time_s)) or np.any(np.diff(time_s) <= 0):
            raise RecordingError(
                f"Run {self.name!r}: time does not increase at every sample.",
                "A device clock that repeats or runs backwards cannot be differentiated.",
                "Repair the clock (wrap, reset) where the data is imported.",
            )
        columns = {name: read_only(values) for name, values in self.columns.items()}
        for name, values in columns.items():
            unit_of(name)
            if values.shape != time_s.shape:
                raise RecordingError(
                    f"Run {self.name!r}: {name} has shape {values.shape}, time {time_s.shape}."
                )
        flags = np.ascontiguousarray(self.flags, dtype=np.uint8)
        if flags.size == 0:
            flags = np.zeros(time_s.size, np.uint8)
        if flags.shape != time_s.shape:
            raise RecordingError(
                f"Run {self.name!r}: flags have shape {flags.shape}, time {time_s.shape}."
            )
        flags = flags.copy()
        flags.flags.writeable = False
        for attribute, value in (
            ("time_s", time_s),
            ("columns", MappingProxyType(columns)),
            ("flags", flags),
            ("conditions", MappingProxyType(dict(self.conditions))),
            ("calibrations", MappingProxyType(dict(self.calibrations))),
        ):
            object.__setattr__(self, attribute, value)

    def __reduce__(self) -> tuple[object, ...]:
        """Travel to other processes: a view of a mapping does not."""
        values = [getattr(self, each.name) for each in fields(self)]
        return Recording, tuple(dict(v) if isinstance(v, Mapping) else v for v in values)

    def __len__(self) -> int:
        return int(self.time_s.size)

    def __contains__(self, name: object) -> bool:
        return name == "time_s" or name in self.columns

    def __getitem__(self, name: str) -> FloatArray:
        """Return one channel, shape (n,).

        Raises:
            MissingChannelError: The recording has no such channel.
        """
        if name == "time_s":
            return self.time_s
        try:
            return self.columns[name]
        except KeyError:
            from estimation.derived import rates_of  # it is made of recordings

            known = [n for column in self.columns for n in (column, *rates_of(column))]
            near = difflib.get_close_matches(name, known, n=1)
            advice = f"Did you mean {near[0]!r}?" if near else OTHER
            if name in known:
                advice = "It is a derivative: estimation.derived.zero_phase_channels returns it."
            raise MissingChannelError(
                f"Run {self.name!r} has no channel {name!r}.",
                f"It has: {', '.join(self.columns) or 'none'}.",
                move_condition([name], [self]) or advice,
            ) from None

    @property
    def valid(self) -> NDArray[np.bool_]:
        """Samples with no flag set, shape (n,)."""
        return np.equal(self.flags, 0)

    @property
    def duration_s(self) -> float:
        """Time from the first sample to the last, s; 0 for fewer than two samples."""
        return float(self.time_s[-1] - self.time_s[0]) if len(self) > 1 else 0.0

    @property
    def sample_rate_hz(self) -> float:
        """Median sample rate, Hz.

        Raises:
            RecordingError: Fewer than two samples.
        """
        if len(self) < 2:
            raise RecordingError(f"Run {self.name!r} has {len(self)} samples: no sample rate.")
        return 1.0 / float(np.median(np.diff(self.time_s)))

    @property
    def ticks(self) -> NDArray[np.int64]:
        """Periods since the first sample, shape (n,).

        Counted from sample to sample: over a long run the median period is off by more than one.
        """
        steps = np.rint(np.diff(self.time_s) * self.sample_rate_hz)
        return np.concatenate([[0], np.cumsum(steps)]).astype(np.int64)

    def at(self, places: NDArray[np.intp]) -> "Recording":
        """Return the samples at these places alone, in their order, shape (k,)."""
        return replace(
            self,
            time_s=self.time_s[places],
            columns={name: values[places] for name, values in self.columns.items()},
            flags=self.flags[places],
        )

    def with_columns(self, **columns: ArrayLike) -> "Recording":
        """Return a recording with these columns added or replaced."""
        added = {name: np.array(values, dtype=np.float64) for name, values in columns.items()}
        return replace(self, columns={**self.columns, **added})

    def with_stretch(self, stretch: Stretch) -> "Recording":
        """Return a recording with one more flagged segment, its samples flagged."""
        inside = (self.time_s >= stretch.start_s) & (self.time_s <= stretch.stop_s)
        flags = np.where(inside, self.flags | np.uint8(stretch.flag), self.flags)
        return replace(self, flags=flags.astype(np.uint8), stretches=(*self.stretches, stretch))

    def exclude(self, reason: str) -> "Recording":
        """Return the recording marked as left out of evidence, with the reason."""
        return replace(self, excluded=reason)


def move_condition(absent: Iterable[str], recordings: Iterable[Recording]) -> str:
    """Return how to make channels of conditions that an equation needs; nothing for others."""
    conditions = {name for recording in recordings for name in recording.conditions}
    for name in sorted(conditions.intersection(absent)):
        return f"{name} is a condition: move its line from [data.conditions] to [data.columns]."
    return ""


def shared_columns(recordings: Iterable[Recording]) -> list[str]:
    """Return the names of the columns that all of some recordings have, sorted."""
    return sorted(set.intersection(*({*recording.columns} for recording in recordings)))
