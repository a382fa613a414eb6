"""A recording as a stream of blocks, with any estimate."""

import itertools
import time
from collections.abc import Iterator, Sequence

import numpy as np

from estimation.channels import ESTIMATED
from estimation.derived import combined
from estimation.recording import Flag, FloatArray, Recording
from rig.errors import DataError, UsageError
from rig.live.block import DeviceStatus, SampleBlock
from rig.live.estimator import LiveEstimator
from rig.live.keys import LEAVE, OF_DISPLAY, Keys, no_keys

OF_REPLAY = {
    "space": ("pause", "pauses, or goes on"),
    "+": ("faster", "doubles the speed"),
    "-": ("slower", "halves the speed"),
    "f": ("skip 5 s", "skips 5 s"),
    **OF_DISPLAY,
    LEAVE: ("quits", "ends the replay"),
}
"""Key to its word and what it does."""
BLOCK_S = 0.05
SKIP_S = 5.0
SHORTEST_WAIT_S, LONGEST_WAIT_S = 1e-4, 0.1
"""A shorter wait is none; keys are read at least as often as the longer one."""


def replay_blocks(
    recording: Recording,
    estimators: Sequence[LiveEstimator],
    speed: float | None,
    keys: Keys = no_keys,
) -> Iterator[SampleBlock]:
    """Yield a recording block by block, at its own pace times a speed; None for no wait.

    Keys change the pace: space pauses, + and - double and halve the speed, f skips 5 s.

    Estimates are the estimators', which have seen nothing yet, and for other channels those
    recorded in `estimated_*` columns. Samples flagged missing and gaps in the clock count as lost.

    Raises:
        DataError: The run holds no samples.
        UsageError: The speed is not positive.
    """
    if len(recording) == 0:
        raise DataError(f"Run {recording.name!r} holds no samples.", "There is nothing to show.")
    if speed is not None and not speed > 0:
        raise UsageError(f"A speed of {speed:g} shows nothing.", fix="Give a positive speed.")
    read = [_read_target(recording, one) for one in estimators]
    known = recording.with_columns(**{name: x for part in read for name, x in part.items()})
    return _blocks(known, estimators, _Pace(speed, keys))


def _read_target(recording: Recording, estimator: LiveEstimator) -> dict[str, FloatArray]:
    """Return a target that is a sum of readings, such as a difference of angles, by its name."""
    name = estimator.target_channel
    if name in recording or estimator.model is None:
        return {}
    sums = estimator.model.signals.combination(name)
    if sums is None or sums.direction or any(s.channel not in recording for s in sums.shares):
        return {}
    return {name: combined(sums, recording.__getitem__)}


def _blocks(
    recording: Recording, estimators: Sequence[LiveEstimator], pace: "_Pace"
) -> Iterator[SampleBlock]:
    lost = lost_samples(recording)
    start_s = float(recording.time_s[0])
    pace.wait_for(start_s)
    block_of = np.floor((recording.time_s - start_s) / BLOCK_S)
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
        pace.wait_for(float(time_s[-1]))
        if pace.is_left:
            return
        status = _status(recording, float(time_s[0]), float(time_s[-1]))
        flags, so_far = recording.flags[part], int(lost[last - 1])
        yield SampleBlock(time_s, columns, flags, estimates, so_far, (status,))


class _Pace:
    def __init__(self, speed: float | None, keys: Keys) -> None:
        self._speed, self._keys = speed, keys
        self._is_paused = False
        self._skip_to_s = -np.inf
        self._from_s: tuple[float, float] | None = None
        self.is_left = False

    def wait_for(self, time_s: float) -> None:
        """Wait until a time of the recording is due, or a person quits."""
        while True:
            self._obey(time_s)
            wait_s = LONGEST_WAIT_S if self._is_paused else self._wait_s(time_s)
            if self.is_left or wait_s < SHORTEST_WAIT_S:
                return
            time.sleep(min(wait_s, LONGEST_WAIT_S))

    def _wait_s(self, time_s: float) -> float:
        """Return the wait by the clock, not from block to block: small delays do not add up."""
        if self._speed is None or time_s < self._skip_to_s:
            self._from_s = None
            return 0.0
        if self._from_s is None:
            self._from_s = time_s, time.monotonic()
        begun_s, began_s = self._from_s
        return (time_s - begun_s) / self._speed - (time.monotonic() - began_s)

    def _obey(self, time_s: float) -> None:
        for key in self._keys():
            self._from_s = None
            if key == LEAVE:
                self.is_left = True
            elif key == " ":
                self._is_paused = not self._is_paused
            elif key == "f":
                self._skip_to_s = time_s + SKIP_S
            elif key in "+-" and self._speed is not None:
                self._speed *= 2.0 if key == "+" else 0.5


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
