"""A force-sensing resistor pressed on a force sensor, as the calibration bench simulates it.

Order: force, rate-independent hysteresis (a stack of play operators, after Prandtl and Ishlinskii),
creep with the logarithm of time, the amplifier's curve (the inverse of the cubic of Zhang et al.
2022), noise and the converter.
"""

import numpy as np
from numpy.typing import NDArray

from calibration.fsr_curve import ZHANG_2022
from estimation.recording import FloatArray

VOLT_PER_COUNT = 3.3 / 4095.0
TOP_COUNT = 4095
TICK_S = 1e-3
PLAY_RATIOS = (0.02, 0.05, 0.1)
"""Half-widths of the play operators over full scale."""
FULL_SCALE_N = 1.755
"""Force at 1 V by the cubic."""


def press_force_n(profile: str, top_n: float, duration_s: float, seed: int) -> FloatArray:
    """Return the force of a press at 1 kHz, shape (n,).

    The profile is `ramp` (up and down once, by a hand as unsteady as the seed makes it) or `hold`
    (on, then constant, by a weight).
    """
    t = np.arange(round(duration_s / TICK_S)) * TICK_S
    if profile == "hold":
        return np.asarray(top_n * np.minimum(t / 0.2, 1.0))
    random = np.random.default_rng(seed)
    raised = 0.5 - 0.5 * np.cos(2 * np.pi * np.minimum(t / (duration_s - 1.0), 1.0))
    tremor = 1.0 + 0.02 * np.sin(2 * np.pi * (random.uniform(0.8, 1.6) * t + random.uniform()))
    return np.asarray(top_n * random.uniform(0.97, 1.0) * raised * tremor)


HYSTERESIS_RATIO = 0.3  # Share of the response that goes through the play operators
CREEP_RATIO = 0.01  # Relative rise a decade of time under load


class PressedFsr:
    """The sensor under one press: a force a tick, shape (n,), whose last value holds on."""

    def __init__(self, force_n: FloatArray, seed: int = 0) -> None:
        self._force_n = force_n
        self._done = 0
        self._plays = np.zeros(len(PLAY_RATIOS))
        self._loaded_s = 0.0
        self._noise = np.random.default_rng(seed)

    def counts(self, ticks: int) -> NDArray[np.int32]:
        """Return the converter's counts of the next ticks, shape (ticks,)."""
        return np.array([self._tick() for _ in range(ticks)], dtype=np.int32)

    def _tick(self) -> int:
        force = float(self._force_n[min(self._done, self._force_n.size - 1)])
        self._done += 1
        widths = np.array(PLAY_RATIOS) * FULL_SCALE_N
        self._plays = np.clip(self._plays, force - widths, force + widths)
        felt = (1 - HYSTERESIS_RATIO) * force + HYSTERESIS_RATIO * float(self._plays.mean())
        self._loaded_s = self._loaded_s + TICK_S if force > 0.1 else 0.0
        volts = _volts(felt)
        if self._loaded_s > 0.1:
            volts *= 1.0 + CREEP_RATIO * np.log10(self._loaded_s / 0.1)
        volts += 0.002 * self._noise.normal()
        return int(min(max(np.floor(volts / VOLT_PER_COUNT + 0.5), 0), TOP_COUNT))


_GRID_V = np.linspace(0.0, 1.0, 4001)
_GRID_N = ZHANG_2022.force_n(_GRID_V)


def _volts(force_n: float) -> float:
    """Return the amplifier's output: the inverse of the cubic, and its slope beyond 1 V."""
    if force_n > _GRID_N[-1]:
        return 1.0 + (force_n - float(_GRID_N[-1])) / 4.44
    return float(np.interp(force_n, _GRID_N, _GRID_V))
