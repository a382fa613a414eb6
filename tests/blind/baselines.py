"""Three textbook ways to pick effects, on the library that `rig diagnose` searches, for comparison.

- `f_test`: an F-test for each candidate on its own, samples taken as independent, with the false
  discovery rate held at 5 % (Benjamini and Hochberg, J. R. Statist. Soc. B 57, 1995);
- `forward_bic`: the candidate that lowers the Bayesian information criterion most, again and again
  (Schwarz, Ann. Statist. 6, 1978);
- `stlsq`: sequentially thresholded least squares (Brunton, Proctor and Kutz, PNAS 113, 2016) as
  pysindy has it, columns scaled to variance 1, threshold a tenth of the residual's standard
  deviation.

A candidate is an effect of the catalogue at one point of its shape's grid, its columns those of the
search. Each method sees the balance's declared columns fitted along.
"""

import itertools
import math
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from estimation.campaign import Campaign
from estimation.diagnosis.balance import lay_out
from estimation.diagnosis.candidate import pool
from estimation.diagnosis.design import covered, prepare, tables
from estimation.diagnosis.instruments import instruments
from estimation.diagnosis.instruments import projection as instrumented
from estimation.fitting import fit
from estimation.model import Model
from estimation.recording import FloatArray

MOST = 8
"""Terms `forward_bic` takes at most."""

TINY = 1e-12


@dataclass(frozen=True, eq=False)
class Library:
    """One balance as a regression, what the declared columns explain taken out of both sides.

    Rows are rotated and the empty ones left out, which no sum of squares and no fit notices.

    Attributes:
        target: Shape (m,).
        columns: Shape (m, k).
        family: Family of each candidate.
        block: Columns of each candidate.
        samples: Samples before the rotation.
        declared: Declared columns.
    """

    target: FloatArray
    columns: FloatArray
    family: Sequence[str]
    block: Sequence[slice]
    samples: int
    declared: int

    @classmethod
    def of(
        cls,
        target: FloatArray,
        declared: FloatArray,
        candidates: Sequence[tuple[str, FloatArray]],
    ) -> "Library":
        """Lay out a library from whole columns of shape (n,), (n, d) and (n, k) each."""
        whole = np.column_stack([*(columns for _, columns in candidates), target])
        basis = np.linalg.qr(declared)[0]
        whole = whole - basis @ (basis.T @ whole)
        rotated = np.linalg.qr(whole, mode="r")
        ends = np.cumsum([0, *(columns.shape[1] for _, columns in candidates)])
        return cls(
            rotated[:, -1],
            rotated[:, :-1],
            [family for family, _ in candidates],
            [slice(a, b) for a, b in itertools.pairwise(ends.tolist())],
            len(target),
            declared.shape[1],
        )


def library(model: Model, campaign: Campaign) -> Library:
    """Fit the declared model and lay out what a diagnosis searches beside it."""
    recordings = list(campaign.timed().evidence)
    fitted = fit(model, Campaign.of(recordings), bootstrap=0)
    measured = sorted(set.intersection(*({*r.columns} for r in recordings)))
    tried = pool(model, measured)
    wanted = [model.target, *model.channels, *instruments(measured)]
    wanted += [channel for c in tried for _, channel in c.channels]
    runs = [prepare(r, dict.fromkeys(wanted), model) for r in recordings]
    tried = covered(tried, runs)
    told = instrumented(runs, tried, model.target)
    balance = lay_out(fitted, [told(run) for run in runs])
    whole = np.vstack(tables(balance.runs, tried, balance.demean))
    declared = np.vstack(balance.columns(balance.terms))
    candidates, at = [], 0
    for candidate in tried:
        count = len(candidate.effect.amplitudes)
        candidates.append((candidate.family, whole[:, at : at + count]))
        at += count
    return Library.of(np.concatenate(balance.target), declared, candidates)


def _falls(target: FloatArray, columns: FloatArray, blocks: Sequence[slice]) -> FloatArray:
    """Return by how much each block of columns lowers the sum of squares, shape (blocks,)."""
    falls = np.zeros(len(blocks))
    for k, block in enumerate(blocks):
        part = columns[:, block]
        scale = np.linalg.norm(part, axis=0)
        part = part[:, scale > TINY] / scale[scale > TINY]
        if part.size:
            weights = np.linalg.lstsq(part, target, rcond=None)[0]
            falls[k] = target @ target - np.sum((target - part @ weights) ** 2)
    return falls


def f_test(given: Library, rate: float = 0.05) -> list[str]:
    """Return the families that an F-test each and Benjamini-Hochberg call discoveries."""
    falls = _falls(given.target, given.columns, given.block)
    whole = float(given.target @ given.target)
    more = np.array([block.stop - block.start for block in given.block])
    free = given.samples - given.declared - more
    p_values = stats.f.sf(falls / more / ((whole - falls) / free), more, free)
    order = np.argsort(p_values)
    below = np.flatnonzero(p_values[order] <= rate * np.arange(1, order.size + 1) / order.size)
    found = order[: int(below.max()) + 1] if below.size else []
    return sorted({given.family[int(k)] for k in found})


def forward_bic(given: Library) -> list[str]:
    """Return the families taken one after the other while the criterion falls, at most `MOST`."""
    n, target, columns = given.samples, given.target.copy(), given.columns.copy()
    chosen: list[str] = []
    while len(chosen) < MOST:
        whole = float(target @ target)
        left = np.maximum(whole - _falls(target, columns, given.block), TINY * whole)
        sizes = np.array([block.stop - block.start for block in given.block])
        change = n * np.log(left / whole) + sizes * math.log(n)
        best = int(np.argmin(change))
        if change[best] >= 0.0:
            break
        chosen.append(given.family[best])
        basis = np.linalg.qr(columns[:, given.block[best]])[0]
        target = target - basis @ (basis.T @ target)
        columns = columns - basis @ (basis.T @ columns)
    return sorted(set(chosen))


def stlsq(given: Library, share: float = 0.1) -> list[str]:
    """Return the families with a column whose scaled weight survives the threshold."""
    from pysindy.optimizers import STLSQ

    scale = np.linalg.norm(given.columns, axis=0) / math.sqrt(given.samples)
    kept = np.flatnonzero(scale > TINY)
    spread = float(np.linalg.norm(given.target)) / math.sqrt(given.samples)
    method = STLSQ(threshold=share * spread, alpha=0.0, max_iter=20)
    with warnings.catch_warnings():  # it warns when nothing, or everything, survives
        warnings.simplefilter("ignore")
        method.fit(given.columns[:, kept] / scale[kept], given.target[:, None])
    alive = set(kept[np.flatnonzero(method.coef_[0])].tolist())
    pairs = zip(given.family, given.block, strict=True)
    return sorted({family for family, block in pairs if alive & {*range(block.start, block.stop)}})


METHODS: Mapping[str, Callable[[Library], list[str]]] = {
    "F-test with Benjamini-Hochberg": f_test,
    "forward BIC": forward_bic,
    "STLSQ of pysindy": stlsq,
}


@dataclass(frozen=True)
class Picked:
    """What one method says of one case: families over all balances, and how long it took."""

    method: str
    families: tuple[str, ...]
    seconds: float


def run_all(models: Sequence[Model], campaign: Campaign) -> list[Picked]:
    """Return what each method picks in any of the balances; making the columns takes no time."""
    families: dict[str, set[str]] = {name: set() for name in METHODS}
    seconds = dict.fromkeys(METHODS, 0.0)
    for model in models:
        given = library(model, campaign)
        for name, method in METHODS.items():
            start = time.perf_counter()
            families[name] |= set(method(given))
            seconds[name] += time.perf_counter() - start
    return [Picked(name, tuple(sorted(families[name])), seconds[name]) for name in METHODS]
