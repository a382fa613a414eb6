"""Simulated campaigns that cannot be memorised, for calibrating and judging a diagnosis.

`draw(seed, kind)` gives a case: recordings with the reference rig's channels, and the answer. The
rig, its controller and sensors, the protocol and the form of what is hidden are all drawn from the
seed, over factors; a form is a random function, so no case repeats another's formula.
"""

from benchmarks.rigs.case import Case, draw
from benchmarks.rigs.recipes import KINDS
from benchmarks.rigs.seeds import CALIBRATE, DEVELOP, JUDGE, part_of
from benchmarks.rigs.structure import HiddenTruth, Truth

__all__ = [
    "CALIBRATE",
    "DEVELOP",
    "JUDGE",
    "KINDS",
    "Case",
    "HiddenTruth",
    "Truth",
    "draw",
    "part_of",
]
