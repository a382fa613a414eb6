"""What goes between a Teensy and an ESCON: set value as voltage or duty, actual current as voltage.

The module has no data bus at run time. In ESCON Studio two points make the line of the set-value
input and of each analog output; the same two points are written here. The board's implementation is
`firmware/boards/escon.hpp`.

Sources: ESCON Module 24/2 Hardware Reference (2021-08), p. 3-20: PWM set value 10 Hz to 5 kHz, duty
10 to 90 %; digital input 1: 0 below 1.0 V, 1 above 2.4 V, switching delay below 8 ms. The two-point
lines are ESCON Studio's. The analog ranges of the 24/2 are taken from its sibling 50/5.
"""

import math
from dataclasses import dataclass
from typing import Literal

from drivers.errors import DriverError
from drivers.teensy.channels import TeensyChannel, motor_current

LOWEST_DUTY, HIGHEST_DUTY = 0.1, 0.9
"""Duties a PWM set value may have."""
ENABLE_DELAY_S = 0.008
"""Longest the enable input takes to act."""
CONTINUOUS_A, PEAK_A = 2.0, 6.0


class SetValueError(DriverError):
    """A current that cannot be asked of the module."""


@dataclass(frozen=True, slots=True)
class Line:
    """A line through two points, as ESCON Studio takes it.

    Attributes:
        x1: One input, V or duty.
        y1: The current there, A.
        x2: Another input.
        y2: The current there, A.
    """

    x1: float
    y1: float
    x2: float
    y2: float

    def __post_init__(self) -> None:
        values = (self.x1, self.y1, self.x2, self.y2)
        if not all(map(math.isfinite, values)) or self.x1 == self.x2 or self.y1 == self.y2:
            raise SetValueError(
                f"({self.x1}, {self.y1}) and ({self.x2}, {self.y2}) make no line.",
                fix="Copy both points from ESCON Studio's configuration report.",
            )

    def current_a(self, x: float) -> float:
        """Return the current at an input."""
        return self.y1 + (x - self.x1) * (self.y2 - self.y1) / (self.x2 - self.x1)

    def input_of(self, current_a: float) -> float:
        """Return the input, V or duty, of a current."""
        return self.x1 + (current_a - self.y1) * (self.x2 - self.x1) / (self.y2 - self.y1)


@dataclass(frozen=True, slots=True)
class EsconWiring:
    """One module at a Teensy.

    Attributes:
        set_value: Voltage or duty of the set-value input, and the size of the current it asks for;
            the sign is that of a direction line, so that a dead set-value wire asks for nothing.
        kind: `analog` for a DAC (Teensy 3.5), `pwm` for a duty (Teensy 4.1).
        read_back: Voltage of the analog output, and the actual current it represents.
        limit_a: Current limit set in ESCON Studio.
        output_bits: Resolution of the DAC or of the PWM.
        output_v: Full scale of the DAC at the set-value input, V; behind an amplifier, its output.
        adc_bits: Resolution of the converter that reads the current.
        adc_v: Full scale of that converter, at the module's output, V.
    """

    set_value: Line
    kind: Literal["analog", "pwm"]
    read_back: Line
    limit_a: float = CONTINUOUS_A
    output_bits: int = 12
    output_v: float = 3.3
    adc_bits: int = 12
    adc_v: float = 3.3

    def __post_init__(self) -> None:
        if not 0 < self.limit_a <= PEAK_A:
            raise SetValueError(f"The module gives up to {PEAK_A:g} A, not {self.limit_a:g} A.")
        low, high = self.input_range
        for current_a in (0.0, self.limit_a):
            wanted = self.set_value.input_of(current_a)
            if not low - 1e-9 <= wanted <= high + 1e-9:
                raise SetValueError(
                    f"{current_a:g} A would need {wanted:g} at the set-value input.",
                    f"It takes {low:g} to {high:g} {'V' if self.kind == 'analog' else 'of duty'}.",
                    "Set the two points in ESCON Studio so that the whole range fits.",
                )

    @property
    def input_range(self) -> tuple[float, float]:
        """What the set-value input takes: V, or duty."""
        return (0.0, self.output_v) if self.kind == "analog" else (LOWEST_DUTY, HIGHEST_DUTY)

    def output_code(self, current_a: float) -> int:
        """Return the code of the DAC or PWM that asks for a current of this size.

        Raises:
            SetValueError: It is not finite or beyond the limit.
        """
        if not (math.isfinite(current_a) and abs(current_a) <= self.limit_a):
            raise SetValueError(
                f"A current of {current_a} A cannot be asked for.",
                f"The module is limited to {self.limit_a:g} A.",
            )
        top = 2**self.output_bits - 1
        full = self.output_v if self.kind == "analog" else 1.0
        code: int = math.floor(self.set_value.input_of(abs(current_a)) / full * top + 0.5)
        return code

    def current_of_code(self, code: int) -> float:
        """Return the size of the current a code asks for, A."""
        full = self.output_v if self.kind == "analog" else 1.0
        return self.set_value.current_a(code * full / (2**self.output_bits - 1))

    def current_of_reading(self, reading: int) -> float:
        """Return the actual current of a reading of the converter, A."""
        return self.read_back.current_a(reading * self.adc_v / (2**self.adc_bits - 1))

    def channel(self, name: str = "motor_current_a", field: str = "current") -> TeensyChannel:
        """Return the actual current as a channel of the logger, from the converter's counts."""
        top = 2**self.adc_bits - 1
        low, high = self.current_of_reading(0), self.current_of_reading(top)
        return motor_current(name, field, (0, low), (top, high))
