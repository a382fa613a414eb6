"""Three textbook ways to pick effects, on the same library of columns, for comparison.

- `f_test`: an F-test for each candidate on its own, samples taken as independent, with the false
  discovery rate held at 5 % (Benjamini and Hochberg, J. R. Statist. Soc. B 57, 1995);
- `forward_bic`: the candidate that lowers the Bayesian information criterion most, again and again
  (Schwarz, Ann. Statist. 6, 1978);
- `stlsq`: sequentially thresholded least squares (Brunton, Proctor and Kutz, PNAS 113, 2016),
  columns scaled to variance 1, threshold a tenth of the residual's standard deviation.

Each sees the balance's declared columns fitted along. Shapes stand at the middle of their range.
"""

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from estimation.campaign import Campaign
from estimation.derived import measured_channels, settled_places, zero_phase_channels
from estimation.effects import catalogue
from estimation.fitting import fit
from estimation.model import Model
from estimation.recording import FloatArray, MissingChannelError, Recording

MOST = 8
"""Terms `forward_bic` takes at most."""

RATE_HZ = 100


@dataclass(frozen=True, eq=False)
class Table:
    """One balance laid out for a regression, means of the runs removed.

    Attributes:
        target: Shape (n,).
        declared: Declared columns, shape (n, d).
        candidates: Family to its columns, each of shape (n, k).
    """

    target: FloatArray
    declared: FloatArray
    candidates: Mapping[str, FloatArray]


def lay_out(model: Model, campaign: Campaign) -> Table:
    """Fit the declared model and return its columns and those of every other catalogue effect."""
    fitted = fit(model, campaign, bootstrap=0)
    own = {term.effect.id for term in fitted.terms}
    others = [
        effect
        for name, effect in catalogue().items()
        # noise shared by both sides of a balance looks like an effect to any of the three
        if name not in own and fitted.target not in effect.roles.values()
    ]
    blocks: dict[str, list[FloatArray]] = {}
    target, declared = [], []
    for recording in campaign.evidence:
        usable = [e for e in others if _there(e.roles.values(), recording)]
        wanted = {c for e in usable for c in e.roles.values()}
        names = [*fitted.channels, fitted.target, *sorted(wanted)]
        whole = zero_phase_channels(recording, names, fitted.low_pass)
        run = whole.at(
            settled_places(whole, fitted.low_pass, int(recording.sample_rate_hz / RATE_HZ))
        )
        target.append(_centred(run[fitted.target]))
        parts = [t.columns(run, t.numbers(t.effect.shape)) for t in fitted.terms]
        declared.append(_centred(np.column_stack(parts)))
        for effect in usable:
            shape = [math.sqrt(p.lower * p.upper) for p in effect.shape]
            inputs = {role: run[channel] for role, channel in effect.roles.items()}
            blocks.setdefault(effect.id, []).append(_centred(effect.columns(inputs, shape)))
    complete = {k: v for k, v in blocks.items() if len(v) == len(target)}
    return Table(
        np.concatenate(target),
        np.concatenate(declared),
        {name: np.concatenate(parts) for name, parts in complete.items()},
    )


def _there(channels: object, recording: Recording) -> bool:
    try:
        return all(name in recording for name in measured_channels(list(channels)))  # type: ignore[call-overload]
    except MissingChannelError:
        return False


def _centred(columns: FloatArray) -> FloatArray:
    centred: FloatArray = columns - columns.mean(axis=0)
    return centred


def _sum_of_squares(target: FloatArray, columns: FloatArray) -> float:
    weights = np.linalg.lstsq(columns, target, rcond=None)[0]
    return float(np.sum((target - columns @ weights) ** 2))


def f_test(table: Table, rate: float = 0.05) -> list[str]:
    """Return the families that an F-test each and Benjamini-Hochberg call discoveries."""
    n, base = table.target.size, _sum_of_squares(table.target, table.declared)
    p_values = {}
    for name, columns in table.candidates.items():
        with_it = np.column_stack([table.declared, columns])
        left, more = _sum_of_squares(table.target, with_it), columns.shape[1]
        free = n - with_it.shape[1]
        p_values[name] = float(stats.f.sf((base - left) / more / (left / free), more, free))
    ranked = sorted(p_values, key=p_values.__getitem__)
    below = [k for k, name in enumerate(ranked, 1) if p_values[name] <= rate * k / len(ranked)]
    return ranked[: max(below, default=0)]


def forward_bic(table: Table) -> list[str]:
    """Return the families taken one after the other while the criterion falls, at most `MOST`."""
    n, chosen, columns = table.target.size, list[str](), table.declared

    def criterion(tried: FloatArray) -> float:
        fit_term = n * math.log(_sum_of_squares(table.target, tried) / n)
        return float(fit_term + tried.shape[1] * math.log(n))

    best = criterion(columns)
    while len(chosen) < MOST:
        rest = [name for name in table.candidates if name not in chosen]
        scores = {
            name: criterion(np.column_stack([columns, table.candidates[name]])) for name in rest
        }
        name = min(scores, key=scores.__getitem__, default=None)
        if name is None or scores[name] >= best:
            return chosen
        best, columns = scores[name], np.column_stack([columns, table.candidates[name]])
        chosen.append(name)
    return chosen


def stlsq(table: Table, share: float = 0.1, rounds: int = 20) -> list[str]:
    """Return the families with a column whose scaled weight survives the threshold."""
    names = [name for name, c in table.candidates.items() for _ in range(c.shape[1])]
    if not names:
        return []
    weights = np.linalg.lstsq(table.declared, table.target, rcond=None)[0]
    left = table.target - table.declared @ weights
    library = np.column_stack(list(table.candidates.values()))
    library = library - table.declared @ np.linalg.lstsq(table.declared, library, rcond=None)[0]
    scale = library.std(axis=0)
    library = library / np.where(scale > 0.0, scale, 1.0)
    kept = scale > 0.0
    threshold = share * left.std()
    for _ in range(rounds):
        found = np.zeros(len(names))
        found[kept] = np.linalg.lstsq(library[:, kept], left, rcond=None)[0]
        still = kept & (np.abs(found) >= threshold)
        if np.array_equal(still, kept):
            break
        kept = still
    return sorted({name for name, stays in zip(names, kept, strict=True) if stays})


METHODS: Mapping[str, Callable[[Table], list[str]]] = {
    "F-test with Benjamini-Hochberg": f_test,
    "forward BIC": forward_bic,
    "STLSQ": stlsq,
}


@dataclass(frozen=True)
class Picked:
    """What one method says of one case: families over all balances, and how long it took."""

    method: str
    families: tuple[str, ...]
    seconds: float


def run_all(models: Sequence[Model], campaign: Campaign) -> list[Picked]:
    """Return what each method picks in any of the balances."""
    tables = [lay_out(model, campaign) for model in models]
    picked = []
    for name, method in METHODS.items():
        start = time.perf_counter()
        families = sorted({family for table in tables for family in method(table)})
        picked.append(Picked(name, tuple(families), time.perf_counter() - start))
    return picked
