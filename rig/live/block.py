"""Input of the display: blocks of samples with the state at their arrival, and a stream of them."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import reduce
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimation.recording import FloatArray
from rig.errors import DataError


class BlockError(DataError):
    """The parts of a block do not belong together."""


@dataclass(frozen=True, slots=True)
class DeviceStatus:
    """State of one device in a word, such as `ok`, `armed` or `stale`, and details of it."""

    name: str
    state: str
    detail: str = ""


@dataclass(frozen=True, slots=True)
class LimitStatus:
    """A watched quantity now, and the magnitude in either direction that trips the rig."""

    name: str
    value: float
    limit: float
    unit: str


@dataclass(frozen=True, eq=False)
class SampleBlock:
    """Consecutive samples, usually 50 ms of them; none when nothing arrived during its time.

    Raises:
        BlockError: The parts are not of one length, or time does not increase.
    """

    time_s: FloatArray  # device clock, shape (n,), increasing
    # channel name to values, shape (n,) each, SI units, closing positive
    columns: Mapping[str, FloatArray]
    flags: NDArray[np.uint8]  # `estimation.recording.Flag` bits, shape (n,), uint8
    # channel name to its estimate, shape (n,) each; may be empty
    estimates: Mapping[str, FloatArray]
    lost: int  # samples lost since the start
    devices: tuple[DeviceStatus, ...]
    limits: tuple[LimitStatus, ...] = ()
    # channel name to whether its estimate is within the fitted range of its estimator, shape (n,)
    # each; channels of estimators without a range are missing
    inside: Mapping[str, NDArray[np.bool_]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        parts: dict[str, NDArray[Any]] = {"flags": self.flags, **self.columns}
        for name, values in chain(parts.items(), self.estimates.items(), self.inside.items()):
            if values.shape != self.time_s.shape:
                raise BlockError(
                    f"{name} of a block has shape {values.shape}, its time {self.time_s.shape}."
                )
        if np.any(~np.isfinite(self.time_s)) or np.any(np.diff(self.time_s) <= 0):
            raise BlockError("The time of a block does not increase at every sample.")

    def __len__(self) -> int:
        return int(self.time_s.size)


def joined(parts: Sequence[Mapping[str, FloatArray]]) -> dict[str, FloatArray]:
    """Return the columns that every part has, one part after the other."""
    shared = [name for name in parts[0] if all(name in part for part in parts)]
    return {name: np.concatenate([part[name] for part in parts]) for name in shared}


Step = Callable[[SampleBlock], SampleBlock]
"""Returns a block with something added to it."""

Sink = Callable[[SampleBlock], None]
"""Shows a block somewhere else than on the terminal."""


def through(
    blocks: Iterator[SampleBlock],
    steps: Iterable[Step] = (),
    sinks: Iterable[Sink] = (),
    duration_s: float | None = None,
) -> Iterator[SampleBlock]:
    """Yield blocks as they come, each after every step and shown on every sink.

    The stream ends after a duration of device time, if any; it is closed when this one is.
    """
    steps, sinks = tuple(steps), tuple(sinks)
    first_s: float | None = None
    try:
        for raw in blocks:
            block = reduce(lambda so_far, step: step(so_far), steps, raw)
            for sink in sinks:
                sink(block)
            yield block
            if duration_s is not None and len(block):
                first_s = float(block.time_s[0]) if first_s is None else first_s
                if float(block.time_s[-1]) - first_s >= duration_s:
                    return
    finally:
        close = getattr(blocks, "close", None)
        if close is not None:
            close()
