"""What can be wired to the logger: quadrature encoders, torque cells, currents, pots and FSRs.

Each is a straight line from the counts of one field of a sample to a unit; slope and zero come from
the calibration or the certificate of the part at hand and are never written down here. Where a part
is linear in something other than voltage (an FSR in conductance), its amplifier makes it so.

Sources: Same Sky AMT10 datasheet (counts = 4 x pulses a turn); FUTEK certificates (N m at full
scale); Tekscan FlexiForce A201 (conductance is proportional to force; inverting amplifier,
Vout = Vref Rf / Rs).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.device import Channel
from drivers.teensy.profile import Profile
from drivers.teensy.reference import REFERENCE

ADC_BITS = 12
ADC_REFERENCE_V = 3.3
"""Of the board's own converter, which reads the `fsr` field."""


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


def quadrature(
    name: str, field: str, counts_per_turn: int, falls_on_closing: bool = False
) -> TeensyChannel:
    """Return the angle of an incremental encoder, rad.

    Args:
        name: Name of the channel.
        field: `motor`, `spindle` or `jaw`.
        counts_per_turn: Counts, four times the pulses a turn.
        falls_on_closing: The count falls as the jaw closes.
    """
    slope = math.copysign(2 * math.pi / counts_per_turn, -1.0 if falls_on_closing else 1.0)
    return linear(name, field, "rad", slope, 0.0, f"encoder, {counts_per_turn} counts a turn")


def torque_cell(
    name: str, field: str, n_m_per_count: float, zero_count: float = 0.0
) -> TeensyChannel:
    """Return the torque of a strain-gauge cell such as the TFF325 behind its amplifier, N m."""
    return linear(name, field, "N m", n_m_per_count, zero_count, "torque cell")


def motor_current(
    name: str, field: str, first: tuple[float, float], second: tuple[float, float]
) -> TeensyChannel:
    """Return a current by the two points of a motor controller's analog output, A.

    Args:
        name: Name of the channel.
        field: `current`.
        first: A count and the current there, A.
        second: Another count and its current.
    """
    slope = (second[1] - first[1]) / (second[0] - first[0])
    return linear(name, field, "A", slope, first[0] - first[1] / slope, "analog output")


def potentiometer(
    name: str, field: str, travel_rad: float, middle_count: float = (2**ADC_BITS - 1) / 2
) -> TeensyChannel:
    """Return the angle of a potentiometer across the converter's reference, rad.

    Args:
        name: Name of the channel.
        field: Field of a field without sign, `fsr`.
        travel_rad: Angle from end to end.
        middle_count: Count at angle 0.
    """
    slope = travel_rad / (2**ADC_BITS - 1)
    return linear(name, field, "rad", slope, middle_count, "potentiometer")


def force_resistor(
    name: str,
    field: str,
    siemens_per_n: float,
    feedback_ohm: float,
    drive_v: float,
    zero_count: float = 0.0,
) -> TeensyChannel:
    """Return the force on an FSR or FlexiForce behind an inverting amplifier, N.

    Args:
        name: Name of the channel.
        field: Field of the converter, `fsr`.
        siemens_per_n: Conductance a newton, from the part's own calibration.
        feedback_ohm: Feedback resistor of the amplifier.
        drive_v: Size of the drive voltage.
        zero_count: Count without force.
    """
    volts_a_count = ADC_REFERENCE_V / (2**ADC_BITS - 1)
    slope = volts_a_count / (drive_v * feedback_ohm * siemens_per_n)
    return linear(name, field, "N", slope, zero_count, "force-sensing resistor")


def _count_range(field: str, profile: Profile) -> tuple[int, int]:
    if field.startswith(("fsr", "force_")):
        return 0, 2**ADC_BITS - 1
    bounds = np.iinfo(profile.sample[field])
    return int(bounds.min), int(bounds.max)


def raw_channels(profile: Profile = REFERENCE) -> tuple[TeensyChannel, ...]:
    """Return every input of a board as it is, in counts."""
    inputs = [*profile.input_names, *(["fsr"] if profile is REFERENCE else [])]
    return tuple(linear(f"{field}_count", field, profile=profile) for field in inputs)
