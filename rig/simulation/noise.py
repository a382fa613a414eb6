"""Counter-based random numbers: a function of seed, tick and stream, so no generator has state.

The numbers do not depend on how a run is cut into calls, and, being made by integer arithmetic,
they are the same on every machine. The mixer is the finaliser of SplitMix64 (Steele, Lea and Flood,
"Fast splittable pseudorandom number generators", OOPSLA 2014).
"""

import numba
import numpy as np

STREAMS_PER_TICK = 16
"""Random numbers that can be drawn in one tick."""

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_MIX_1 = np.uint64(0xBF58476D1CE4E5B9)
_MIX_2 = np.uint64(0x94D049BB133111EB)
_LANE = np.uint64(0xFFFF)
_SHIFT_16, _SHIFT_32, _SHIFT_48 = np.uint64(16), np.uint64(32), np.uint64(48)
_SHIFT_30, _SHIFT_27, _SHIFT_31 = np.uint64(30), np.uint64(27), np.uint64(31)
_MEAN = 4 * 65535.0
_SCALE = 1.0 / float(np.sqrt(8 * (65536.0**2 - 1) / 12.0))


@numba.njit()
def mix(word: np.uint64) -> np.uint64:
    """Scramble 64 bits so that neighbouring inputs give unrelated outputs."""
    word = (word ^ (word >> _SHIFT_30)) * _MIX_1
    word = (word ^ (word >> _SHIFT_27)) * _MIX_2
    return word ^ (word >> _SHIFT_31)


@numba.njit()
def _lanes(word: np.uint64) -> float:
    return float(
        (word & _LANE)
        + ((word >> _SHIFT_16) & _LANE)
        + ((word >> _SHIFT_32) & _LANE)
        + (word >> _SHIFT_48)
    )


@numba.njit()
def normal(seed: np.uint64, tick: int, stream: int) -> float:
    """Return a number of mean 0 and variance 1, nearly normal: the sum of eight uniform ones.

    It is never beyond 4.9 and its kurtosis is 2.85 where the normal distribution has 3. Ticks count
    since the bench was made; a stream is one of the tick's `STREAMS_PER_TICK` numbers.
    """
    counter = np.uint64(tick * STREAMS_PER_TICK + stream) * np.uint64(2)
    first = mix(seed + counter * _GOLDEN)
    second = mix(seed + (counter + np.uint64(1)) * _GOLDEN)
    return (_lanes(first) + _lanes(second) - _MEAN) * _SCALE
