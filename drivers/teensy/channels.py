"""The inputs of the logger as channels: a straight line from the counts of one field to a unit."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.device import Channel
from drivers.teensy.profile import Profile
from drivers.teensy.reference import REFERENCE

ADC_BITS = 12


@dataclass(frozen=True, slots=True)
class TeensyChannel:
    """One quantity made from one field of a sample: `slope * (count - zero_count)`.

    Attributes:
        field: Field of a sample, see `drivers.teensy.reference.SAMPLE_DTYPE`.
        slope: Unit a count.
        zero_count: Count at 0.
        channel: Name, unit, rate and range of the result.
    """

    field: str
    slope: float
    zero_count: float
    channel: Channel

    def values(self, samples: NDArray[np.void]) -> NDArray[np.float64]:
        """Return the quantity in samples of shape (n,), float64 of shape (n,)."""
        counts: NDArray[np.float64] = samples[self.field].astype(np.float64)
        return self.slope * (counts - self.zero_count)


def linear(
    name: str,
    field: str,
    unit: str = "count",
    slope: float = 1.0,
    zero_count: float = 0.0,
    description: str = "",
    profile: Profile = REFERENCE,
) -> TeensyChannel:
    """Return a channel by slope and zero; raw counts by default.

    Raises:
        ValueError: No such field, or a slope that is 0 or not finite.
    """
    if field not in (profile.sample.names or ()):
        raise ValueError(f"a sample has no field {field!r}")
    if not (math.isfinite(slope) and slope and math.isfinite(zero_count)):
        raise ValueError(f"slope {slope} and zero {zero_count} of {name} make no line")
    ends = [slope * (count - zero_count) for count in _count_range(field, profile)]
    channel = Channel(
        name, unit, profile.rate_hz, min(ends), max(ends), description or f"field {field}"
    )
    return TeensyChannel(field, slope, zero_count, channel)


def _count_range(field: str, profile: Profile) -> tuple[int, int]:
    if field.startswith(("fsr", "force_")):
        return 0, 2**ADC_BITS - 1
    bounds = np.iinfo(profile.sample[field])
    return int(bounds.min), int(bounds.max)


def raw_channels(profile: Profile = REFERENCE) -> tuple[TeensyChannel, ...]:
    """Return every input of a board as it is, in counts."""
    inputs = [*profile.input_names, *(["fsr"] if profile is REFERENCE else [])]
    return tuple(linear(f"{field}_count", field, profile=profile) for field in inputs)
