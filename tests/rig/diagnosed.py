"""A diagnosis with its signals, made from synthetic runs in a second."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from estimation import model_file
from estimation.causes.verdict import answer
from estimation.diagnosis.result import Diagnosis
from estimation.diagnosis.split import split
from rig.diagnosis.traces import Traces, traces
from tests.estimation.synthetic import campaign

RIPPLE_N_M = 3e-3


def example() -> tuple[Diagnosis, Traces]:
    """Return a diagnosis that found a ripple of seven waves a motor turn, and its signals.

    Its name is made less sure than it is, so that a page of it has every part.
    """
    runs = list(campaign(lambda angle, speed, load: RIPPLE_N_M * np.sin(7 * angle)))
    found = answer(runs, [model_file.read(Path("motor"))], split(runs, 0))
    (sure,) = found.diagnosis.findings
    assert sure.family == "ripple.motor"
    doubted = replace(
        sure,
        verdict="one_of",
        alternatives=("ripple.current",),
        confidence=0.71,
        probabilities={"ripple.motor": 0.71, "ripple.current": 0.25},
    )
    told = {"notes": ("A note with a <tag> & more.",), "noise_floor": {"motor": 1e-3}}
    return replace(found.diagnosis, findings=(doubted,), **told), traces(found)
