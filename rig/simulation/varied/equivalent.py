"""Which families of the catalogue reproduce a hidden effect on the runs at hand.

Worked out, not declared: the effect's own signal, as each equation sees it, is fitted by the
declared terms with and without a family's columns beside them, free of noise. A family counts as
good as the effect where what it cannot reproduce would not be seen in the noise of these runs.
"""

from collections.abc import Iterator, Mapping, Sequence
from itertools import product

import numpy as np

from estimation.candidates import candidates
from estimation.derived import CABLE_ANGLE, CABLE_LOAD, GEARBOX, MOTOR_LOAD, zero_phase_channels
from estimation.model import Term
from estimation.recording import FloatArray, Recording
from rig.simulation.varied import residual
from rig.simulation.varied.residual import EQUATIONS, EVERY, Fitted, Prepared

POINTS = 40
"""Most points of a family's shapes that are tried."""

ODDS = 6.0
"""Twice the logarithm of likelihoods that noise leaves open: odds of twenty to one."""

FORM = 0.02
"""Share of an effect's power that counts as its form, not as another cause."""

LONGEST_LAG = 60


def reproducing(
    recordings: Sequence[Recording],
    runs: Sequence[Prepared],
    columns: Mapping[str, Sequence[FloatArray]],
    clean: Mapping[str, Fitted],
    known: Sequence[str],
) -> tuple[str, ...]:
    """Return the families that reproduce an effect to within the noise of these runs.

    Args:
        recordings: The runs without noise, the effect on.
        runs: The same, filtered.
        columns: Equation to the effect's true columns, one array (n, k) a run.
        clean: The declared equations fitted on noisy runs without the effect: what noise is.
        known: The effect's own families: at least as good as the best of these is good enough.
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
        beyond = _left(base, whole)
        seen = ODDS * noise / count
        if beyond < 4.0 * seen:
            continue  # this equation does not show it
        lefts = _lefts(recordings, runs, equation, base, whole)
        own = min((lefts[f] for f in known if f in lefts), default=0.0)
        enough = own + seen + FORM * beyond
        fitting = {family for family, left in lefts.items() if left <= enough}
        good = fitting if good is None else good & fitting
    return tuple(sorted((good or set()) | set(known[:1])))


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
    moved = (wide - middle)[:, np.any(wide != middle, axis=0)]
    return np.hstack([middle, moved])


def _left(table: FloatArray, whole: FloatArray) -> float:
    """Return the mean square that a least-squares fit leaves."""
    scale = np.sqrt(np.mean(table**2, axis=0)) + np.finfo(float).tiny
    gram = (table / scale).T @ (table / scale) / len(whole)
    right = (table / scale).T @ whole / len(whole)
    weights = np.linalg.lstsq(gram, right, rcond=1e-10)[0]
    return float(max(np.mean(whole**2) - weights @ right, 0.0))


def _lefts(
    recordings: Sequence[Recording],
    runs: Sequence[Prepared],
    equation: str,
    base: FloatArray,
    whole: FloatArray,
) -> dict[str, float]:
    """Return family to the least that its columns leave beside the declared ones."""
    model = residual.declared(equation)
    declared_ids = {term.effect.id for term in model.terms}
    terms = [
        term
        for term in candidates(equation, list(recordings[0].columns))
        if term.effect.id not in declared_ids and term.effect.id != "sensor.offset"
    ]
    names = list(dict.fromkeys(c for term in terms for c in term.channels.values()))
    thin = [_channels(r, run, names) for r, run in zip(recordings, runs, strict=True)]
    kept = [run.places[equation] // EVERY for run in runs]
    found: dict[str, float] = {}
    for term in terms:
        for shape in _shapes(term):
            tables = [
                residual.centred(term.columns(channels, shape)[at])
                for channels, at in zip(thin, kept, strict=True)
            ]
            left = _left(np.hstack([base, np.concatenate(tables)]), whole)
            family = term.effect.family
            found[family] = min(found.get(family, np.inf), left)
    return found


def _channels(recording: Recording, run: Prepared, names: Sequence[str]) -> dict[str, FloatArray]:
    """Return a run's channels at every tenth sample; loads that others predict are as measured."""
    instead = {
        MOTOR_LOAD: run.channels["proximal_torque_n_m"],
        CABLE_LOAD: run.channels["proximal_torque_n_m"],
        CABLE_ANGLE: run.channels["jaw_angle_rad"],
        GEARBOX: run.channels[GEARBOX],
    }
    others = [name for name in names if name not in instead and name not in run.channels]
    filtered = zero_phase_channels(recording, others)
    found = {name: filtered[name] for name in [*others, "time_s"]}
    return {name: values[::EVERY] for name, values in {**run.channels, **found, **instead}.items()}


def _shapes(term: Term) -> Iterator[tuple[float, ...]]:
    grids = [[float(x) for x in p.grid()] for p in term.effect.shape]
    most = max(2, int(POINTS ** (1.0 / len(grids)))) if grids else 1
    thinned = []
    for values in grids:
        places = np.linspace(0, len(values) - 1, min(most, len(values)))
        thinned.append([values[round(p)] for p in places])
    yield from product(*thinned)
