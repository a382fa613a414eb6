"""Simulated campaigns that cannot be memorised, for calibrating and judging a diagnosis.

`draw(seed, kind)` gives a case: recordings with the reference rig's channels, and the answer. The
rig, its controller and sensors, the protocol and the form of what is hidden are all drawn from the
seed, over factors; a form is a random function, so no case repeats another's formula.
"""

from rig.simulation.varied.case import Case, NoCaseError, draw
from rig.simulation.varied.recipes import KINDS
from rig.simulation.varied.seeds import CALIBRATE, DEVELOP, JUDGE, part_of
from rig.simulation.varied.truth import HiddenTruth, Truth

__all__ = [
    "CALIBRATE",
    "DEVELOP",
    "JUDGE",
    "KINDS",
    "Case",
    "HiddenTruth",
    "NoCaseError",
    "Truth",
    "draw",
    "part_of",
]
