"""The processing of the grip campaigns: filtered without lag, then the samples that close the jaw.

Source: J. J. O'Neill, T. K. Stephens, T. M. Kowalewski, "Evaluation of torque measurement
surrogates as applied to grip torque and jaw angle estimation of robotic surgical tools", IEEE
Robotics and Automation Letters 2018, section II.C.
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from estimation.derived import zero_phase_channels
from estimation.filters import PAPER, LowPass
from estimation.recording import Recording
from estimation.rest import SPINDLE_SPEED, closing


def processed(recording: Recording, names: Iterable[str], low_pass: LowPass = PAPER) -> Recording:
    """Filter and derive channels as the paper does; the spindle speed is always among them.

    Raises:
        MissingChannelError: A measured channel is not in the recording.
        FilterError: The run cannot be filtered.
    """
    return zero_phase_channels(recording, [*names, SPINDLE_SPEED], low_pass)


def is_closing(run: Recording) -> NDArray[np.bool_]:
    """Return which samples of a processed run the paper keeps, shape (n,)."""
    return closing(run[SPINDLE_SPEED], run.sample_rate_hz)


def closing_samples(run: Recording, keep_flagged: bool = True) -> Recording:
    """Return the closing samples of a run from `processed`.

    The paper knows no flags, so its counts and its errors come out only with flagged samples.
    """
    kept = is_closing(run)
    if not keep_flagged:
        kept &= run.valid
    return run.at(np.flatnonzero(kept))
