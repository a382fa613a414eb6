"""Which families of the catalogue reproduce a hidden effect on the runs at hand.

Worked out, not declared: the effect's own signal, as each equation sees it, is fitted by the
declared terms with and without a family's columns, free of noise. A family counts as
good as the effect where what it cannot reproduce would not be seen in the noise of these runs, with
amplitudes that a machine can have.
"""

from collections.abc import Iterator, Mapping, Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

from benchmarks.rigs import residual
from benchmarks.rigs.residual import EQUATIONS, GEARBOX, Fitted, Prepared
from estimation.derived import zero_phase_channels
from estimation.effects import Remembering
from estimation.model import Term
from estimation.recording import FloatArray, Recording
from estimation.within_bounds import solve_within
from rig.simulation.reference_roles import CABLE_ANGLE, CABLE_LOAD, MOTOR_LOAD, candidates

POINTS = 25
"""Most points of a family's shapes that are tried."""

ODDS = 6.0
"""Twice the logarithm of likelihoods that noise cannot separate: odds of twenty to one."""

FORM = 0.1
"""Share of an effect's power that counts as its form, not as another cause: true forms are
distorted, and the residual of the catalogue's form of the true family may be as large."""

STRIDE = 4
"""One in so many samples of 1 kHz is walked over by a family with memory."""

FREE = 0.5
"""Share of itself by which a declared gain may change next to a family: one that takes the whole
torque from another column does not explain this machine."""

LEVER = 0.7
"""Largest variation of a lever, share of it, which the waves of a form have in equal parts: that up
to which `benchmarks.rigs.build` draws one."""

TORQUES = ("motor", "cable")
"""Equations between torques, where an eccentricity is a share of a lever."""

SAME: Mapping[str, str] = {"friction.capstan": "friction.load"}
"""Family to the one that it cannot differ from: over a constant wrap a cable's pull is multiplied
by a factor on each way, which is a gain and friction proportional to the load."""

LONGEST_LAG = 60


def reproducing(
    recordings: Sequence[Recording],
    bare: Sequence[Prepared],
    runs: Sequence[Prepared],
    columns: Mapping[str, Sequence[FloatArray]],
    clean: Mapping[str, Fitted],
    known: Sequence[str],
) -> tuple[str, ...]:
    """Return the families that reproduce an effect to within the noise of these runs.

    Args:
        recordings: The runs without noise and without the effect. Families take their channels from
            these: where the effect is on, a reading that carries it would reproduce anything.
        bare: The same without effects, filtered.
        runs: The runs without noise, the effect on, filtered.
        columns: Equation to the effect's true columns, one array (n, k) a run.
        clean: The declared equations fitted on noisy runs without the effect: what noise is.
        known: The effect's own families, of which the first is always among the answer.
    """
    good: set[str] | None = None
    for equation in EQUATIONS:
        signal = [c.sum(axis=1) for c in columns[equation]]
        places = [run.places[equation] for run in runs]
        whole = np.concatenate(
            [residual.centred(s[p]) for s, p in zip(signal, places, strict=True)]
        )
        noise = clean[equation].rms() ** 2
        count = len(whole) / spread(clean[equation].residuals)
        base = np.concatenate(
            [residual.centred(_base(run, equation, clean[equation])) for run in runs]
        )
        gains = clean[equation].weights
        beyond = _left(base, whole, gains)
        seen = ODDS * noise / count
        if beyond < 4.0 * seen:
            continue  # this equation does not show it
        lefts = _lefts(recordings, bare, equation, places, (base, whole, gains))
        enough = seen + FORM * beyond
        fitting = {family for family, left in lefts.items() if left <= enough}
        good = fitting if good is None else good & fitting
    found = (good or set()) | set(known[:1])
    return tuple(sorted({SAME.get(family, family) for family in found}))


def spread(residuals: Sequence[FloatArray]) -> float:
    """Return how many samples of some residuals are worth one: their integrated correlation."""
    total, power = np.zeros(LONGEST_LAG), 0.0
    for part in residuals:
        n = min(LONGEST_LAG, len(part) - 1)
        total[:n] += [float(part[k:] @ part[: len(part) - k]) for k in range(n)]
        power += float(part @ part)
    return float(max(1.0, 1.0 + 2.0 * np.sum(total[1:]) / power))


def _base(run: Prepared, equation: str, fitted: Fitted) -> FloatArray:
    """Return the declared columns and their derivative by the friction's width."""
    middle = residual.columns_of(run, equation, fitted.widths)
    if not fitted.widths:
        return middle
    wide = residual.columns_of(run, equation, [1.05 * w for w in fitted.widths])
    sign = residual.sign_column(equation)
    return np.hstack([middle, (wide - middle)[:, [sign]]])


def _left(
    table: FloatArray,
    whole: FloatArray,
    gains: FloatArray,
    own: Sequence[tuple[float, float]] = (),
) -> float:
    """Return the mean square residual of a least-squares fit, declared gains near their own.

    Args:
        table: Declared columns, the derivative by a width if there is one, a family's columns.
        whole: What is fitted.
        gains: Of the declared columns; each may change by `FREE` of itself.
        own: Lower and upper bound of each of the family's amplitudes.
    """
    scale = np.sqrt(np.mean(table**2, axis=0)) + np.finfo(float).tiny
    scaled = table / scale
    gram = scaled.T @ scaled / len(whole)
    right = scaled.T @ whole / len(whole)
    most = np.full(len(scale), np.inf)
    most[: len(gains)] = FREE * np.abs(gains) * scale[: len(gains)]
    low, high = -most, most.copy()
    if own:
        at = len(scale) - len(own)
        low[at:], high[at:] = np.transpose(own) * scale[at:]
    weights = solve_within(gram, right, low - 1e-300, high + 1e-300)
    left = np.mean(whole**2) - 2.0 * weights @ right + weights @ gram @ weights
    return float(max(left, 0.0))


def _lefts(
    recordings: Sequence[Recording],
    runs: Sequence[Prepared],
    equation: str,
    places: Sequence[NDArray[np.intp]],
    fitted: tuple[FloatArray, FloatArray, FloatArray],
) -> dict[str, float]:
    """Return family to the least residual with its columns and the declared ones."""
    base, whole, gains = fitted
    model = residual.declared(equation)
    declared_ids = {term.effect.id for term in model.terms}
    terms = [
        term
        for term in candidates(equation, list(recordings[0].columns))
        if term.effect.id not in declared_ids
    ]
    names = list(dict.fromkeys(c for term in terms for c in term.channels.values()))
    whole_runs = [_channels(r, run, names) for r, run in zip(recordings, runs, strict=True)]
    found: dict[str, float] = {}
    for term in terms:
        bounds = _bounds(term, equation)
        for shape in _shapes(term):
            tables = [
                residual.centred(_columns(term, shape, channels, at))
                for channels, at in zip(whole_runs, places, strict=True)
            ]
            left = _left(np.hstack([base, np.concatenate(tables)]), whole, gains, bounds)
            family = term.effect.family
            found[family] = min(found.get(family, np.inf), left)
    return found


def _bounds(term: Term, equation: str) -> list[tuple[float, float]]:
    """Return the bounds of a term's amplitudes as they are added to an equation's target."""
    if term.effect.family == "eccentric.load" and equation in TORQUES:
        count = len(term.effect.amplitudes)
        return [(-2.0 * LEVER / count, 2.0 * LEVER / count)] * count  # a sine and a cosine a wave
    if term.effect.balances.get(equation, 1) > 0:
        return [(p.lower, p.upper) for p in term.effect.amplitudes]
    return [(-p.upper, -p.lower) for p in term.effect.amplitudes]


def _columns(
    term: Term, shape: Sequence[float], channels: Mapping[str, FloatArray], at: NDArray[np.intp]
) -> FloatArray:
    """Return a term's columns at some samples; one with memory walks over every few of them."""
    if not isinstance(term.effect, Remembering):
        return term.columns({c: channels[c][at] for c in term.channels.values()}, shape)
    thin = {c: channels[c][::STRIDE] for c in term.channels.values()}
    walked = term.columns(thin, shape)
    return np.column_stack([np.interp(at / STRIDE, np.arange(len(w)), w) for w in walked.T])


def _channels(recording: Recording, run: Prepared, names: Sequence[str]) -> dict[str, FloatArray]:
    """Return a run's channels; loads that others predict are as measured."""
    instead = {
        MOTOR_LOAD: run.channels["proximal_torque_n_m"],
        CABLE_LOAD: run.channels["proximal_torque_n_m"],
        CABLE_ANGLE: run.channels["jaw_angle_rad"],
        GEARBOX: run.channels[GEARBOX],
    }
    others = [name for name in names if name not in instead and name not in run.channels]
    derived = zero_phase_channels(recording, [*others, "motor_angle_rad"]).columns
    return {**run.channels, **{name: derived[name] for name in others}, **instead}


def _shapes(term: Term) -> Iterator[tuple[float, ...]]:
    grids = [[float(x) for x in p.grid()] for p in term.effect.shape]
    most = max(2, int(POINTS ** (1.0 / len(grids)))) if grids else 1
    thinned = []
    for values in grids:
        places = np.linspace(0, len(values) - 1, min(most, len(values)))
        thinned.append([values[round(p)] for p in places])
    yield from product(*thinned)
