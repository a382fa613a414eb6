"""Any device where a session expects a logger: a drive behind the board's logic, or a sensor.

A drive is armed, guarded and moved by the compiled core (`rig.logic.link`); what it measures
besides position and current is added to the samples.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.lib import recfunctions

from calibration.linear import CalibrationSet, LinearCalibration
from drivers.device import Channel, SampleFlag
from drivers.teensy.driver import SampleBatch, TeensyLogger
from drivers.teensy.profile import Profile
from drivers.transport.transport import Transport
from estimation.channels import UnknownUnitError, unit_of
from rig.bench.sensor_logger import FLAGS, SensorLogger, SensorWay
from rig.errors import UsageError
from rig.log.schema import Field, Stream
from rig.log.streams import COUNTS
from rig.logic.link import LogicLink


class DriveLogger(TeensyLogger):
    """The logger whose logic runs in this computer, with all that its drive measures."""

    def __init__(self, link: LogicLink, profile: Profile) -> None:
        super().__init__(link, profile)
        self._logic = link
        self.channels = link.channels

    def read(self, timeout_s: float) -> SampleBatch:
        """Return the samples that have come; one that the drive did not answer is flagged."""
        batch = super().read(timeout_s)
        taken = {tick_us: (values, flags) for tick_us, values, flags in self._logic.bench.samples}
        missing = (dict.fromkeys((c.name for c in self.channels), np.nan), SampleFlag.MISSING)
        rows = [taken.get(tick, missing) for tick in batch.samples["tick_us"].tolist()]
        columns = [np.array([row[0][c.name] for row in rows], np.float64) for c in self.channels]
        samples = recfunctions.append_fields(
            batch.samples,
            [*(c.name for c in self.channels), FLAGS],
            [*columns, np.array([row[1] for row in rows], np.uint8)],
            usemask=False,
        )
        return SampleBatch(np.asarray(samples), batch.tick_us, batch.lost)


def logger_on(way: Transport, profile: Profile) -> TeensyLogger | SensorLogger:
    """Return the logger at the end of a way, as a session uses it."""
    if isinstance(way, SensorWay):
        return SensorLogger(way)
    if isinstance(way, LogicLink):
        return DriveLogger(way, profile)
    return TeensyLogger(way, profile)


def with_channels(
    calibrations: CalibrationSet, channels: Sequence[Channel], has_logger: bool
) -> CalibrationSet:
    """Return calibrations with those of a device's channels that already are in SI units.

    Raises:
        UsageError: A line is of a field that the device does not give, or no channel is in SI.
    """
    names = {channel.name for channel in channels}
    foreign = (
        []
        if has_logger
        else [line for line in calibrations.channels.values() if line.counts not in names]
    )
    if foreign:
        raise UsageError(
            f"The device has no channel {foreign[0].counts!r}, of which the calibration"
            f" {calibrations.name!r} makes {foreign[0].channel}.",
            f"It has: {', '.join(sorted(names))}.",
            'Write calibration = "sensor", or a file whose counts are channels of the device.',
        )
    own = {name: LinearCalibration(name, c, 1.0, source="as sent") for name, c in _in_si(channels)}
    used = {line.counts for line in calibrations.channels.values()}
    lines = {name: line for name, line in own.items() if line.counts not in used}
    whole: Mapping[str, LinearCalibration] = {**lines, **calibrations.channels}
    if not whole:
        raise UsageError(
            "No channel of the device is in SI units.",
            f"It has: {', '.join(sorted(names))}.",
            "Name a calibration that makes SI units of its counts.",
        )
    return CalibrationSet(calibrations.name, whole)


def raw_stream(channels: Sequence[Channel], counts: Stream, has_logger: bool) -> Stream:
    """Return the stream of a device's own samples in a log, which calibrations are applied to."""
    measured = [
        Field(c.name, "float64", "" if c.unit == "count" else c.unit, c.description)
        for c in channels
    ]
    numbers = [f for f in counts.fields if f.name in ("sequence", "tick_us", "status")]
    kept = counts.fields if has_logger else tuple(numbers)
    return Stream(COUNTS, counts.message_type, (*measured, *kept), channels[0].rate_hz)


def _in_si(channels: Sequence[Channel]) -> list[tuple[str, str]]:
    """Return SI name and own name of each channel that is in SI units."""
    named = []
    for channel in channels:
        name = f"{channel.name}_ratio" if channel.unit == "1" else channel.name
        try:
            unit_of(name)
        except UnknownUnitError:
            continue
        named.append((name, channel.name))
    return named
