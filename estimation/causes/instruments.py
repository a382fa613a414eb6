"""Torques and currents predicted from sensors that an equation does not read.

A candidate that reads a sensor of its own equation can explain that sensor's noise. Each effort
that an equation reads (a torque, a force, a current) is therefore replaced by its prediction
through the other declared equations: an instrumental variable. Angles are used as measured.
"""

import itertools
from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from estimation.causes.equations import Equation
from estimation.causes.laid import centred
from estimation.causes.layout import Layout
from estimation.causes.run_signals import ANGLES, RunSignals
from estimation.derived import MOTION, rates_of
from estimation.filters import FilterError, zero_phase
from estimation.recording import FloatArray

NOISY, CLEAN = 0.7, 0.1
"""Shares of a channel that are noise: most of its power above the first, little below the other."""

BAND, MOST_BANDS = 4.0, 3
"""Ratio of the cutoffs of neighbouring bands, and how many bands may be noisy."""


def instrumented(channel: str, equation: str) -> str:
    """Return the name under which a channel's prediction for one equation is kept."""
    return f"{channel} for {equation}"


def estimated(channel: str, equation: str) -> str:
    """Return the name under which an equation's own estimate of its target is kept."""
    return f"{channel} by {equation}"


def add_instruments(layout: Layout, train: Sequence[str]) -> None:
    """Add to every run the efforts of every equation, predicted without that equation's sensors.

    A prediction stands in for a reading where it is the better of the two: where its discrepancy
    to the reading is at most the equation's residual, which holds the reading's noise. Else
    a target is replaced by its own equation's estimate if that is quieter. The training runs
    decide which reading is replaced.
    """
    torques = [e for e in layout.equations.values() if not e.of_angle]
    trained = {run.name for run in layout.runs} & set(train)
    layout.shaken[:] = [run.shaken() for run in layout.runs]
    for equation in layout.equations.values():
        own = set(_efforts(equation))
        apart: set[str] = set()  # from no noise of this equation's own accelerations either
        known = []
        for run in (*layout.runs, *layout.shaken):
            known.append(_propagated(torques, run, own))
            apart |= set(_propagated([e for e in torques if e is not equation], run, own))
        seen = [(r, k) for r, k in zip(layout.runs, known, strict=False) if r.name in trained]
        good = {c for c in own if _is_better(equation, c, seen)}
        layout.independent.update((c, equation.name) for c in good & apart)
        takes_its_place = equation.target not in good and equation.is_quieter([r for r, _ in seen])
        for run, others in zip((*layout.runs, *layout.shaken), known, strict=True):
            for channel in good:
                run.channels[instrumented(channel, equation.name)] = others[channel]
            _add_estimate(equation, run, takes_its_place)
        if takes_its_place:
            _add_readings(equation, layout.runs, trained)


def signal(run: RunSignals, channel: str, equation: str, as_read: bool = False) -> str:
    """Return the channel that stands for another one in an equation: its prediction if any.

    Or, as it is read, the reading of a target that its equation's estimate stands for.
    """
    known = (read(channel, equation),) if as_read else ()
    names = (*known, instrumented(channel, equation))
    return next((name for name in names if name in run.channels), channel)


def read(channel: str, equation: str) -> str:
    """Return the name under which the reading of a target is kept in the scale of its estimate."""
    return f"{channel} read for {equation}"


def stands_for_itself(run: RunSignals, channel: str, equation: str) -> bool:
    """Whether an equation's own estimate stands for its target."""
    estimate = run.channels.get(estimated(channel, equation))
    return estimate is not None and run.channels.get(instrumented(channel, equation)) is estimate


def declared_of(equation: Equation, run: RunSignals) -> FloatArray:
    """Return the declared columns with efforts predicted from other sensors, (n, declared)."""
    return _declared(equation, run)[run.grid[run.used[equation.name]]]


def instead_noise(layout: Layout) -> Mapping[str, FloatArray]:
    """Return the noise of columns of predicted efforts less that of the readings' own columns.

    Equation to columns of all runs that zeros fill up, (runs, samples, declared), without those
    equations that read no effort that is predicted.
    """
    found = dict[str, FloatArray]()
    if not layout.shaken:
        return found
    for name, equation in layout.equations.items():
        names = [column.channel for column in equation.kinds]
        predicted = [bool(c) and signal(layout.runs[0], c, name) != c for c in names]
        if not any(predicted):
            continue
        columns = []
        for run, shaken in zip(layout.runs, layout.shaken, strict=True):
            own = declared_of(equation, shaken) - declared_of(equation, run)
            own -= equation.noise(run)[run.grid[run.used[name]], :-1]
            columns.append(own * np.array(predicted))
        found[name] = centred(columns)[0]
    return found


def noise_share(runs: Sequence[RunSignals], channel: str, cutoff_hz: float = np.inf) -> float:
    """Return the noise of a channel over all that it holds below a cutoff, the median over runs."""
    sizes = [
        [_below(x[channel], run, cutoff_hz)[run.grid].std() for x in (run.noise, run.channels)]
        for run in runs
        if channel in run.noise
    ]
    return float(np.median([noise / (size or 1.0) for noise, size in sizes] or [0.0]))


def noisy_bands(equation: Equation, runs: Sequence[RunSignals]) -> list[tuple[int, float]]:
    """Return the noisy bands of the columns that are a channel times a constant.

    Of each, its place among the declared columns and the cutoff that the band is above, Hz.
    """
    return [
        (k, cutoff_hz)
        for k, column in enumerate(equation.kinds)
        if column.channel
        for cutoff_hz in _cutoffs(runs, column.channel)
    ]


def _cutoffs(runs: Sequence[RunSignals], channel: str) -> Iterator[float]:
    """Yield the cutoffs of the bands of a noisy channel, down to what is clean."""
    above = np.inf
    for step in range(1, MOST_BANDS + 1):
        if noise_share(runs, channel, above) <= (NOISY if step == 1 else CLEAN):
            return
        above = runs[0].low_pass.cutoff_hz / BAND**step
        yield above


def above(equation: Equation, run: RunSignals, bands: Sequence[tuple[int, float]]) -> FloatArray:
    """Return declared columns less what is below the cutoff of each band, shape (n, bands)."""
    columns, used = _declared(equation, run), run.grid[run.used[equation.name]]
    found = [columns[:, k] - _below(columns[:, k], run, cutoff_hz) for k, cutoff_hz in bands]
    return np.column_stack([x[used] for x in found])


def _below(values: FloatArray, run: RunSignals, cutoff_hz: float) -> FloatArray:
    """Return values filtered at a cutoff; as they are where there are too few of them."""
    if not np.isfinite(cutoff_hz):
        return values
    try:
        return zero_phase(values, run.rate_hz, replace(run.low_pass, cutoff_hz=cutoff_hz))
    except FilterError:
        return values


def _declared(equation: Equation, run: RunSignals) -> FloatArray:
    seen = dict(run.channels)
    for channel in equation.channels:
        seen[channel] = run.channels[signal(run, channel, equation.name)]
        if "_rate_" in channel:
            source = channel.replace("_rate_n_m_s", "_n_m")
            read = run.channels[signal(run, source, equation.name)]
            seen[channel] = np.gradient(read) * run.rate_hz
    return equation.columns(seen)


def _efforts(equation: Equation) -> list[str]:
    """Return the channels of an equation that are efforts: neither angles nor their derivatives."""
    motion = (*ANGLES, *itertools.chain(*MOTION.values()))
    names = [n for n in equation.channels if not n.endswith(motion) and "_rate_" not in n]
    return names if equation.of_angle else [equation.target, *names]


def _is_better(
    equation: Equation,
    channel: str,
    runs: Sequence[tuple[RunSignals, Mapping[str, FloatArray]]],
) -> bool:
    """Whether an effort's prediction adds no more error to an equation than there is."""
    if any(channel not in known for _, known in runs):
        return False
    gain = 1.0 if channel == equation.target else equation.channels[channel]
    added = left = 0.0
    for run, known in runs:
        used = run.grid[run.used[equation.name]]
        residual = run.channels[equation.target] - equation.estimate(run.channels)
        added += gain**2 * float(np.var((known[channel] - run.channels[channel])[used]))
        left += float(np.var(residual[used]))
    return added <= left


def _add_estimate(equation: Equation, run: RunSignals, takes_its_place: bool) -> None:
    """Add what an equation predicts for its target, which may take its place, and for its speed."""
    target = equation.estimate(run.channels)
    run.channels[estimated(equation.target, equation.name)] = target
    if not takes_its_place:
        return
    if equation.of_angle:  # an estimate has no offset, and a place along the travel needs one
        target = target + float(np.mean(run.channels[equation.target] - target))
    run.channels[instrumented(equation.target, equation.name)] = target
    for speed in rates_of(equation.target)[:1]:
        run.channels[instrumented(speed, equation.name)] = np.gradient(target) * run.rate_hz


def _add_readings(equation: Equation, runs: Sequence[RunSignals], train: Container[str]) -> None:
    """Add the target's reading in the scale of its estimate, with the mean of that in each run.

    Next to what the equation lacks, the estimate may be far too small.
    """
    target, across, square = equation.target, 0.0, 0.0
    estimate = estimated(target, equation.name)
    for run in runs:
        if run.name in train:
            own = run.channels[target] - run.channels[target].mean()
            across += float(own @ run.channels[estimate])
            square += float(own @ own)
    for run in runs:
        own = run.channels[target] - run.channels[target].mean()
        scaled = across / (square or 1.0) * own
        run.channels[read(target, equation.name)] = scaled + run.channels[estimate].mean()


def _propagated(
    relations: Sequence[Equation], run: RunSignals, without: set[str]
) -> Mapping[str, FloatArray]:
    """Return every effort that can be worked out from sensors other than some."""
    efforts = {n for e in relations for n in _efforts(e)}
    known = {n: run.channels[n] for n in efforts if n not in without}
    for _ in relations:
        for relation in relations:
            missing = [n for n in _efforts(relation) if n not in known]
            if len(missing) != 1:
                continue
            (name,) = missing
            weight = 1.0 if name == relation.target else relation.channels[name]
            if weight == 0.0:
                continue
            zero = np.zeros_like(run.channels["time_s"])
            others = relation.estimate(run.channels | known | {name: zero})
            left = zero if name == relation.target else known[relation.target]
            known[name] = others if name == relation.target else (left - others) / weight
    return known
