"""A recording as a stream of blocks, with any estimate."""

import itertools
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Protocol

import numpy as np

from estimation.recording import Flag, Recording
from rig.errors import DataError, UsageError
from rig.live.block import DeviceStatus, FloatArray, SampleBlock

ESTIMATED = "estimated_"
"""A column so prefixed holds the estimate that was made while recording."""


class EstimateStream(Protocol):
    """A causal estimator in the middle of a stream."""

    @property
    def target_channel(self) -> str:
        """The channel it estimates."""

    def push(self, columns: Mapping[str, FloatArray], time_s: FloatArray) -> FloatArray:
        """Return the estimate of the next samples, shape (n,), and keep the final state."""


def replay_blocks(
    recording: Recording,
    estimators: Sequence[EstimateStream],
    speed: float | None,
    block_s: float = 0.05,
    sleep: Callable[[float], None] = time.sleep,
    clock: Callable[[], float] = time.monotonic,
) -> Iterator[SampleBlock]:
    """Yield a recording block by block, at the pace of its own clock or faster.

    Estimates are the estimators', and those recorded in `estimated_*` columns for other channels.
    Samples flagged missing and gaps in the clock count as lost.

    Args:
        recording: The run.
        estimators: Streams that have seen nothing yet; none for none.
        speed: Times real time; None for as fast as it can be read.
        block_s: Time a block covers, s.
        sleep: Waits, s.
        clock: Monotonic time, s.

    Raises:
        DataError: The run holds no samples.
        UsageError: The speed is not positive.
    """
    if len(recording) == 0:
        raise DataError(f"Run {recording.name!r} holds no samples.", "There is nothing to show.")
    if speed is not None and not speed > 0:
        raise UsageError(f"A speed of {speed:g} shows nothing.", fix="Give a positive speed.")
    return _blocks(recording, estimators, speed, block_s, sleep, clock)


def _blocks(
    recording: Recording,
    estimators: Sequence[EstimateStream],
    speed: float | None,
    block_s: float,
    sleep: Callable[[float], None],
    clock: Callable[[], float],
) -> Iterator[SampleBlock]:
    lost = lost_samples(recording)
    start_s, began_s = float(recording.time_s[0]), clock()
    block_of = np.floor((recording.time_s - start_s) / block_s)
    edges = [0, *(np.flatnonzero(np.diff(block_of)) + 1).tolist(), len(recording)]
    for first, last in itertools.pairwise(edges):
        part = slice(first, last)
        time_s = recording.time_s[part]
        columns = {name: values[part] for name, values in recording.columns.items()}
        estimates = {
            name.removeprefix(ESTIMATED): values
            for name, values in columns.items()
            if name.startswith(ESTIMATED)
        }
        for estimator in estimators:
            estimates[estimator.target_channel] = estimator.push(columns, time_s)
        if speed is not None:
            # against the clock and not from block to block, so that small delays do not add up
            wait_s = (float(time_s[-1]) - start_s) / speed - (clock() - began_s)
            if wait_s > 0:
                sleep(wait_s)
        yield SampleBlock(
            time_s=time_s,
            columns=columns,
            flags=recording.flags[part],
            estimates=estimates,
            lost=int(lost[last - 1]),
            devices=(_status(recording, float(time_s[0]), float(time_s[-1])),),
        )


def lost_samples(recording: Recording) -> FloatArray:
    """Return the samples lost up to each sample, shape (n,).

    A sample flagged missing is lost, and so are those that fit into a gap of the clock.
    """
    steps = np.diff(recording.time_s)
    period_s = float(np.median(steps)) if steps.size else 1.0
    skipped = np.maximum(np.round(steps / period_s) - 1, 0)
    missing = (recording.flags & Flag.MISSING) != 0
    return np.cumsum(np.concatenate([[0.0], skipped]) + missing)


def _status(recording: Recording, first_s: float, last_s: float) -> DeviceStatus:
    """Return the run as a device, with the reason of the flagged stretch it is in."""
    for stretch in recording.stretches:
        if stretch.start_s <= last_s and stretch.stop_s >= first_s:
            return DeviceStatus("recording", str(stretch.flag.name).lower(), stretch.reason)
    return DeviceStatus("recording", "ok", recording.source)
