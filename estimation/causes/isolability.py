"""The causes that a set of runs can distinguish, before anything is wrong with the machine.

Every named effect in turn is added to the runs, of one size, and all candidates compete for it as
they do in a diagnosis. A family that is not chosen with a high probability there is not
distinguishable.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from estimation.causes.acting import solved
from estimation.causes.blocks import block_of
from estimation.causes.candidates import Candidate, Group, candidates
from estimation.causes.findings import family_probabilities
from estimation.causes.folds import Folds, folds_of
from estimation.causes.functions import Function
from estimation.causes.instruments import add_instruments
from estimation.causes.joint import Joint
from estimation.causes.layout import lay_out
from estimation.causes.levels import with_levels
from estimation.causes.nuisances import skews, with_skews
from estimation.causes.scoring import assessed, best_of_each
from estimation.model import Model
from estimation.recording import FloatArray, Recording

SHAPES = 2
"""Shapes of each effect that are added: spread over those that a diagnosis tries."""

NOTHING = "nothing"
"""Stands for no cause among the families."""

EXPLAINED = 0.1
"""Share of the residual that a candidate must explain on all runs to compete."""


@dataclass(frozen=True)
class Isolable:
    """The expected conclusion of a diagnosis on one effect.

    Attributes:
        place: Where it acts.
        family: The effect.
        equation: Equation it would be reported under.
        share: Expected probability of its own family.
        others: Other family to its expected probability; `unknown` is a function of no known form,
            and `NOTHING` that no cause is found. The most probable is first.
    """

    place: str
    family: str
    equation: str
    share: float
    others: Mapping[str, float]


def isolability(
    models: Sequence[Model],
    recordings: Sequence[Recording],
    on_part: Callable[[int, int], None] = lambda done, count: None,
) -> list[Isolable]:
    """Return the expected conclusion on each effect from these runs, the vaguest first.

    Each effect is as large as the residual of the declared equations on these runs, recorded or
    simulated without it. `on_part` is called with the number of effects done and of all.

    Raises:
        LayoutError: No equation can be laid out on these runs.
        FitError: A declared equation cannot be identified.
    """
    names = [r.name for r in recordings]
    layout = with_levels(lay_out(models, recordings, names), names)
    add_instruments(layout, names)
    plain = Joint(layout)
    joint = with_skews(plain, skews(plain))
    pool, folds = candidates(joint), folds_of(layout)
    effects = _effects(pool)
    out: list[Isolable] = []
    for done, (name, shapes) in enumerate(effects.items()):
        on_part(done, len(effects))
        shares = [
            _shares(joint.with_effect(one.laid, _amplitudes(joint, one)), pool, folds)
            for one in shapes
        ]
        mean = {
            family: sum(s.get(family, 0.0) for s in shares) / len(shares)
            for family in dict.fromkeys(f for s in shares for f in s)
        }
        own = mean.pop(name[1], 0.0)
        others = dict(sorted(mean.items(), key=lambda pair: -pair[1]))
        out.append(Isolable(name[0], name[1], shapes[0].cause.place.home, own, others))
    on_part(len(effects), len(effects))
    return sorted(out, key=lambda one: one.share)


def _effects(pool: Iterable[Group]) -> dict[tuple[str, str], list[Candidate]]:
    """Return place and family to some of the shapes of each named effect."""
    found: dict[tuple[str, str], list[Candidate]] = {}
    for group in pool:
        for one in group.candidates:
            if not isinstance(one.cause, Function):
                found.setdefault((one.cause.place.name, one.cause.family), []).append(one)
    return {
        name: [shapes[k] for k in _spread(len(shapes), SHAPES)] for name, shapes in found.items()
    }


def _spread(count: int, most: int) -> list[int]:
    """Return places spread over a list, its ends left out where there are enough."""
    return sorted({int(k) for k in (np.arange(min(count, most)) + 0.5) * count / min(count, most)})


def _amplitudes(joint: Joint, one: Candidate) -> FloatArray:
    """Return equal amplitudes at which the effect is as large as the declared error there."""
    ones = np.ones(one.laid.size.shape[1])
    power = max(
        float(np.sum((x[:, 0] @ ones) ** 2))
        / (joint.samples[name, "within"].sum() * joint.error[name, "within"])
        for name, x in one.laid.inner.items()
    )
    return np.asarray(ones / np.sqrt(max(power, 1e-300)))


def _shares(joint: Joint, pool: Sequence[Group], folds: Folds) -> dict[str, float]:
    """Return each family's probability, and that of no cause."""
    near = [g for group in pool if (g := _near(joint, group)) is not None]
    ranked = best_of_each(assessed(joint, near, folds))
    likely = family_probabilities(ranked, joint.numbers) if ranked else []
    found = {one.family: one.share for one in likely}
    return found | {NOTHING: 1.0 - sum(found.values())}


def _near(joint: Joint, group: Group) -> Group | None:
    """Return the candidates of a group that explain something of the residual of all runs."""
    block = group.block or block_of(joint, group.laid)
    right: FloatArray = np.zeros(())
    whole = 0.0
    base = joint.left_out(((),)).base[0]
    for name, inner in group.laid.inner.items():
        p = (name, "within")
        table, weight = joint.tables[p], joint.weights[p]
        left = table[..., -1] - table[..., :-1] @ base[joint.at[p]]
        right = right + weight * (left[:, None, None] @ inner)[:, :, 0].sum(axis=0)
        whole += weight * float(np.sum(left**2))
    own = sum(joint.weights[p] * x.own.sum(axis=0) for p, x in block.of.items() if p[1] == "within")
    explained = (right * solved(right, own)).sum(axis=1) / whole
    kept = np.flatnonzero(explained > EXPLAINED)
    if not len(kept):
        return None
    kept_candidates = [group.candidates[int(k)] for k in kept]
    return Group(kept_candidates, group.laid.only(kept), group.precision[kept])
