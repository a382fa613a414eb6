"""What Zhao and Nelson 2016 state of their experiments and what they measured."""

from collections.abc import Mapping

DOFS = ("grasp", "pitch", "yaw")
INPUTS = ("long", "short", "periodic")
LEVELS_N = (0.5, 1.0, 1.5, 2.0)
LONG_S, SHORT_S = 26.0, 2.0

PAPER_COEFFICIENTS: Mapping[str, float | None] = {"grasp": 1.28, "pitch": None, "yaw": 1.55}
"""One over Table 2; the pitch's is missing in our copy of the text."""
PAPER_ERRORS_N: Mapping[str, tuple[float, float, float]] = {
    "grasp": (0.24, 0.46, 0.49),
    "pitch": (0.14, 0.37, 0.71),
    "yaw": (-0.03, 0.07, 0.05),
}
"""Table 3, in the order of `INPUTS`."""
PAPER_DELAYS_MS: Mapping[str, float] = {"grasp": 0.0, "pitch": -20.0, "yaw": 0.0}
"""Table 4."""
