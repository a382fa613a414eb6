"""The streams of a run: samples in SI units, the raw counts they were made from, and commands.

Both carry the sequence number, so that a sample finds its counts. The SI stream is what people and
programs read; the counts are kept so that a log can be read again with another calibration.
"""

from collections.abc import Sequence

from estimation.channels import describe
from rig.log.schema import Field, Stream

SAMPLE = "/rig/sample"
COUNTS = "/rig/counts"
FLIGHT = "/rig/flight"
DEVICES = "/rig/device/"
"""Topics of further devices begin so and end in the device's name."""
RATE_HZ = 1000.0
FLIGHT_BYTES = 56
"""Bytes of commands in one message."""

COUNTS_STREAM = Stream(
    COUNTS,
    "rig_msgs/msg/Counts",
    (
        Field("motor", "int32", "", "motor encoder, rises on closing"),
        Field("spindle", "int32", "", "spindle encoder, falls on closing"),
        Field("jaw", "int32", "", "jaw encoder, rises on closing"),
        Field("target", "int32", "", "target of the spindle, counts of its encoder"),
        Field("proximal", "int32", "", "torque sensor at the spindle, rises on closing"),
        Field("distal", "int32", "", "torque sensor at the jaw, falls on closing"),
        Field("current", "int32", "", "measured motor current, rises on closing"),
        Field("fsr", "int32", "", "force-sensing resistor"),
        Field("command_e4", "int32", "", "motor command, 1e-4 of full scale, falls on closing"),
        Field("load_ma", "int32", "", "current commanded to the load motor, mA"),
        Field("sequence", "uint32", "", "number of the sample since the stream began"),
        Field("tick_us", "uint32", "", "device clock as sent, wraps at 2^32"),
        Field("status", "uint32", "", "status bits of the logger"),
    ),
    RATE_HZ,
)
"""The logger's raw counts with their raw signs."""


FLIGHT_STREAM = Stream(
    FLIGHT,
    "rig_msgs/msg/Flight",
    (
        *(
            Field(f"word_{k}", "uint64", "", "bytes sent to the board, little-endian")
            for k in range(FLIGHT_BYTES // 8)
        ),
        Field("tick_us", "uint64", "", "device clock when they were sent, without its wrap"),
        Field("size", "uint8", "", "bytes used"),
    ),
)
"""What the host sent to the board since the session began."""


def sample_stream(channels: Sequence[str], rate_hz: float | None) -> Stream:
    """Return the stream of SI samples with these channels, `time_s` in front, and expected rate.

    Raises:
        UnknownUnitError: A channel carries no unit.
        LayoutError: A channel's name cannot be a field's.
    """
    described = [describe(name) for name in ("time_s", *channels)]
    fields = [Field(c.name, "float64", c.unit, c.description) for c in described]
    return Stream(
        SAMPLE,
        "rig_msgs/msg/Sample",
        (
            *fields,
            Field("sequence", "uint32", "", "number of the sample"),
            Field("flags", "uint32", "", "1 saturated, 2 stale, 4 missing, 8 suspect"),
        ),
        rate_hz,
    )
