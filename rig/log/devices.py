"""Channels of further devices in a log, on the times of the run's samples.

Every device has a stream and a rate of its own. A recording has one time a sample, so a slower
device is interpolated, and of a faster one the mean over each sample's period is taken.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid

from estimation.channels import unit_or_none
from estimation.recording import Flag, FloatArray
from rig.log.reader import LogFile, Topic
from rig.log.streams import DEVICES, SAMPLE

LONGEST_GAP = 2.5
"""Periods without a sample of a device from which on its value is unknown."""


def channel_of(device: str, channel: str) -> str:
    """Return the name of a further device's channel in a recording, such as `ft_force_z_n`."""
    return f"{device}_{channel}"


def topic_of(device: str) -> str:
    """Return the topic of a further device's stream."""
    return f"{DEVICES}{device}"


def device_topics(log: LogFile) -> list[str]:
    """Return the topics of further devices that a log has, read or not."""
    return [topic for topic in log.indexed if topic.startswith(DEVICES)]


def device_columns(log: LogFile) -> tuple[dict[str, FloatArray], NDArray[np.uint8]]:
    """Return the channels of further devices at the samples of a log with the topic `/rig/sample`.

    Channels in raw counts are left out: they have no unit.

    Returns:
        Values by channel, shape (n,) each, NaN where a device sent nothing; and the flags of the
        devices' samples at those times, shape (n,).
    """
    time_s = log.topics[SAMPLE].rows["time_s"]
    columns: dict[str, FloatArray] = {}
    flags = np.zeros(time_s.size, np.uint8)
    for name, topic in log.topics.items():
        if not name.startswith(DEVICES):
            continue
        device = name.removeprefix(DEVICES)
        channels = [f.name for f in topic.stream.fields if f.dtype == "float64"]
        known = {c: channel_of(device, c) for c in channels if c != "time_s"}
        known = {c: named for c, named in known.items() if unit_or_none(named) is not None}
        found, reported = _at(time_s, topic, list(known)) if known else ({}, flags)
        columns |= {known[channel]: values for channel, values in found.items()}
        flags = flags | reported
    return columns, flags


def _at(
    time_s: FloatArray, topic: Topic, channels: list[str]
) -> tuple[dict[str, FloatArray], NDArray[np.uint8]]:
    """Return channels of one device at these times, and its flags."""
    rows = topic.rows[(topic.rows["flags"] & Flag.MISSING) == 0]
    own_s = rows["time_s"]
    if own_s.size < 2 or time_s.size < 2:
        nothing = np.full(time_s.size, np.nan)
        return dict.fromkeys(channels, nothing), np.full(time_s.size, Flag.MISSING, np.uint8)
    period_s, own_period_s = float(np.median(np.diff(time_s))), float(np.median(np.diff(own_s)))
    after = np.searchsorted(own_s, time_s).clip(1, own_s.size - 1)
    before = after - 1
    gap_s = np.maximum(own_s[after] - own_s[before], 0)
    beyond_s = np.maximum(own_s[0] - time_s, time_s - own_s[-1])
    allowed_s = LONGEST_GAP * max(period_s, own_period_s)
    absent = (gap_s > allowed_s) | (beyond_s > allowed_s)
    nearest = np.where(time_s - own_s[before] < own_s[after] - time_s, before, after)
    flags = np.where(absent, Flag.MISSING, rows["flags"][nearest]).astype(np.uint8)
    width_s = period_s if own_period_s < period_s else 0.0
    found = {}
    for channel in channels:
        values = _means(time_s, width_s, own_s, rows[channel])
        found[channel] = np.where(absent, np.nan, values)
    return found, flags


def _means(time_s: FloatArray, width_s: float, own_s: FloatArray, values: FloatArray) -> FloatArray:
    """Return the means of values over windows around times, shape (n,); the values for width 0."""
    held = np.interp(time_s, own_s, values)
    if not width_s:
        return held
    area = cumulative_trapezoid(values, own_s, initial=0)
    low_s, high_s = np.clip([time_s - width_s / 2, time_s + width_s / 2], own_s[0], own_s[-1])
    covered_s = np.maximum(high_s - low_s, np.finfo(float).tiny)
    means = (np.interp(high_s, own_s, area) - np.interp(low_s, own_s, area)) / covered_s
    return np.where(high_s > low_s, means, held)
