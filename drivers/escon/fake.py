"""An ESCON 24/2 at the other end of the wires: duty or volts in, volts out, enable and ready lines.

Not modelled: its current controller (the current follows at once) and the offset of its inputs.
"""

from drivers.escon.scaling import (
    CONTINUOUS_A,
    ENABLE_DELAY_S,
    HIGHEST_DUTY,
    LOWEST_DUTY,
    EsconWiring,
)

PEAK_S = 4.0
"""How long the peak current lasts; the sheet's figure was not found, so it is an assumption."""


class EsconFake:
    """A module, stepped in ticks of 1 ms.

    Args:
        wiring: What was set in ESCON Studio.
        noise_v: Half width of the noise of its analog output, V.
    """

    def __init__(self, wiring: EsconWiring, noise_v: float = 0.004) -> None:
        self._wiring = wiring
        self._noise_v = noise_v
        self._asked = False
        self._enabled_for_s = 0.0
        self._heat_a2_s = 0.0
        self._random = 1
        self.fault = False
        """Whether it has a fault; cleared by taking enable away and giving it again."""
        self.current_a = 0.0
        """Actual current of the motor."""

    @property
    def ready(self) -> bool:
        """Level of the ready output: low on a fault."""
        return not self.fault

    def tick(self, code: int, enable: bool, positive: bool = True) -> int:
        """Let 1 ms pass and return the converter's reading of the actual current.

        Args:
            code: Code of the DAC or PWM at the set-value input.
            enable: Level of the enable input.
            positive: Level of the direction input.
        """
        if enable and not self._asked:
            self.fault = False
        self._asked = enable
        self._enabled_for_s = self._enabled_for_s + 1e-3 if enable else 0.0
        live = self._enabled_for_s > ENABLE_DELAY_S and not self.fault
        size_a = self._obeyed(code) if live else 0.0
        self.current_a = size_a if positive else -size_a
        self._heat_a2_s += 1e-3 * (self.current_a**2 - CONTINUOUS_A**2)
        self._heat_a2_s = max(self._heat_a2_s, 0.0)
        if self._heat_a2_s > PEAK_S * ((3 * CONTINUOUS_A) ** 2 - CONTINUOUS_A**2):
            self.fault = True
        return self._reading()

    def _obeyed(self, code: int) -> float:
        wiring = self._wiring
        duty = code / (2**wiring.output_bits - 1)
        if wiring.kind == "pwm":
            duty = min(max(duty, LOWEST_DUTY), HIGHEST_DUTY)
        full = wiring.output_v if wiring.kind == "analog" else 1.0
        asked_a = wiring.set_value.current_a(duty * full)
        return min(max(asked_a, 0.0), wiring.limit_a)

    def _reading(self) -> int:
        self._random = (self._random * 1103515245 + 12345) % 2**32
        noise_v = self._noise_v * ((self._random >> 16) % 201 - 100) / 100
        volts = self._wiring.read_back.input_of(self.current_a) + noise_v
        top = 2**self._wiring.adc_bits - 1
        reading = round(volts / self._wiring.adc_v * top)
        return int(min(max(reading, 0), top))
