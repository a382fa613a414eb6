"""Amplitudes that recordings do not separate, because their columns differ by noise only."""

from collections import Counter
from collections.abc import Sequence

import numpy as np

from estimation.campaign import Campaign
from estimation.derived import CAMPAIGN_TIME
from estimation.effects import Proportional
from estimation.fit_problem import OFFSET
from estimation.model import Model, Term
from estimation.noise import MOST_NOISE
from estimation.noise_check import noises
from estimation.recording import FloatArray, Recording


def inseparable(fitted: Model, campaign: Campaign) -> str:
    """Return which amplitudes of a fit these runs do not separate, a sentence; empty if none.

    Under a single load the motion follows from what drives it. What a column has of its own next to
    the others is then mostly noise of the readings, and that decides the amplitudes.
    """
    terms = [t for t in fitted.terms if not (fitted.run_offsets and t.effect.id == OFFSET)]
    if any(t.effect.start() or CAMPAIGN_TIME in t.channels.values() for t in terms):
        return ""  # such a column needs more than the samples that count
    columns, noise = _products(fitted, terms, campaign)
    amplitudes = _labels(terms)
    shown = np.flatnonzero(np.diag(columns) > 0.0)
    named = []
    for k in shown:
        rest = shown[shown != k]
        own = np.zeros(len(columns))
        own[k] = 1.0
        own[rest] = -np.linalg.lstsq(columns[np.ix_(rest, rest)], columns[rest, k])[0]
        if own @ noise @ own > MOST_NOISE**2 * (own @ columns @ own):
            named.append(amplitudes[k])
    if len(named) < 2:  # a channel that is itself mostly noise is stated as such
        return ""
    return (
        f"{', '.join(named)}: in these runs one of these terms follows from the others, but for"
        " noise of the readings. The values are not identified, though their intervals may be"
        " narrow. Record runs under other loads or on other paths, too."
        f"{_same(list(campaign.evidence))}"
    )


def _labels(terms: Sequence[Term]) -> list[str]:
    """Return the name of each amplitude, with its channels where two terms share it."""
    amplitudes = [(t, p.name) for t in terms for p in t.effect.amplitudes]
    count = Counter((t.effect.id, name) for t, name in amplitudes)
    return [
        f"{t.effect.id} {name}"
        + f" ({', '.join(t.channels.values())})" * (count[t.effect.id, name] > 1)
        for t, name in amplitudes
    ]


def _same(runs: Sequence[Recording]) -> str:
    """Return which conditions are the same in all runs, a sentence; empty if none."""
    first, *others = (run.conditions for run in runs)
    shared = [(n, x) for n, x in first.items() if all(o.get(n) == x for o in others)]
    same = [f"{n} is {x if isinstance(x, str) else f'{x:g}'}" for n, x in shared]
    return f" In all of them {', '.join(same)}." if same else ""


def _products(
    model: Model, terms: Sequence[Term], campaign: Campaign
) -> tuple[FloatArray, FloatArray]:
    """Return the products of the columns of size one, and of the noise in them.

    The noise in a column that is not proportional to its channel is left out.
    """
    linear = [isinstance(t.effect, Proportional) and t.effect.id != OFFSET for t in terms]
    heard = np.repeat(linear, [len(t.effect.amplitudes) for t in terms])
    columns, noise = (np.zeros((heard.size, heard.size)) for _ in range(2))
    for both in noises(model, campaign, model.channels):
        own, white = (
            np.hstack([t.columns(c, t.numbers(t.effect.shape)) for t in terms]) for c in both
        )
        white = white * heard
        if model.run_offsets:
            own, white = own - own.mean(axis=0), white - white.mean(axis=0)
        columns += own.T @ own
        noise += white.T @ white
    size = np.sqrt(np.maximum(np.diag(columns), np.finfo(float).tiny))
    scale = np.outer(size, size)
    return columns / scale, noise / scale
