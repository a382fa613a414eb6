"""How well each campaign's model predicts a third campaign."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from estimation.causes.candidates import Claim, laid_out, with_skews
from estimation.causes.equations import Layout
from estimation.causes.joint import Joint
from estimation.causes.scoring import Scored
from estimation.changes.difference import Predicted
from estimation.recording import FloatArray

A, B, ON = "A:", "B:", "C:"
"""What the names of the runs of each campaign begin with."""


def errors(layout: Layout, late: Sequence[Claim], causes: Sequence[Scored]) -> dict[str, Predicted]:
    """Return the errors on the third campaign's runs, by four models."""
    names = [run.name for run in layout.runs]
    of = {p: np.array([float(n.startswith(p)) for n in names]) for p in (A, B, ON)}
    plain = with_skews(Joint(layout), late)
    errors = [_rms(plain, plain.fitted_on(of[side]), of[ON]) for side in (A, B)]
    for taken_as in (A, B):
        grown = plain
        for one in causes:
            later = bool((one.candidate.acts or ())[-1])
            own = {A: not later, B: later, ON: (taken_as == B) == later}
            acts = tuple(own[name[:2]] for name in names)
            laid = laid_out(plain, replace(Claim(one.candidate.cause), acts=acts, given=True))
            if laid is not None:
                grown = grown.with_cause(laid.laid, laid.precision)
        errors.append(_rms(grown, grown.fitted_on(of[A] + of[B]), of[ON]))
    out = {}
    for name, equation in layout.equations.items():
        with_a, with_b, as_a, as_b = (found[name] for found in errors)
        out[name] = Predicted(with_a, with_b, as_a, as_b, equation.model.unit)
    return out


def _rms(joint: Joint, base: FloatArray, counts: FloatArray) -> dict[str, float]:
    """Return the root mean square error of each equation within some runs."""
    vector = np.append(base, -1.0)
    out = {}
    for name in joint.layout.equations:
        p = (name, "within")
        squared = np.einsum("i,rij,j->r", vector, joint.gram[p], vector)
        out[name] = float(np.sqrt(max(squared @ counts, 0.0) / (joint.samples[p] @ counts)))
    return out
