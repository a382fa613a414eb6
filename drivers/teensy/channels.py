"""The inputs of the logger as channels: counts of one field of a sample."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.device import Channel
from drivers.teensy.profile import Profile
from drivers.teensy.reference import REFERENCE

ADC_BITS = 12


@dataclass(frozen=True, slots=True)
class TeensyChannel:
    """The counts of one field of a sample.

    Attributes:
        field: Field of a sample, see `drivers.teensy.reference.SAMPLE_DTYPE`.
        channel: Name, rate and range.
    """

    field: str
    channel: Channel

    def values(self, samples: NDArray[np.void]) -> NDArray[np.float64]:
        """Return the counts in samples of shape (n,), float64 of shape (n,)."""
        counts: NDArray[np.float64] = samples[self.field].astype(np.float64)
        return counts


def raw_channel(
    name: str, field: str, profile: Profile = REFERENCE, description: str = ""
) -> TeensyChannel:
    """Return a field of a board's samples as a channel."""
    low, high = 0, 2**ADC_BITS - 1
    if not field.startswith(("fsr", "force_")):
        bounds = np.iinfo(profile.sample[field])
        low, high = int(bounds.min), int(bounds.max)
    about = description or f"field {field}"
    return TeensyChannel(field, Channel(name, "count", profile.rate_hz, low, high, about))


def raw_channels(profile: Profile = REFERENCE) -> tuple[TeensyChannel, ...]:
    """Return every input of a board."""
    inputs = [*profile.input_names, *(["fsr"] if profile is REFERENCE else [])]
    return tuple(raw_channel(f"{field}_count", field, profile) for field in inputs)
