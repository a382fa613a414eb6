"""Runs in which a channel is probably in another unit, or of the other sign, than in the rest.

Each is a question in words. A channel is compared with itself in the other runs, and only where it
is alike in most of them.
"""

from collections.abc import Callable, Collection, Iterator, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from estimation.channels import unit_of
from estimation.recording import FloatArray, Recording, shared_columns
from rig.importers.derivatives import CONFUSED
from rig.importers.table.units import conversion

ALIKE, MOST = 2.0, 0.75
"""Factor within which a channel varies alike in runs, and the share of runs that must agree."""

FAR = 5.0
"""Factor from which a run is apart; below the least one between confused units, a turn in rad."""

SURE = 1.25
"""Factor between a ratio and that of a unit which is allowed in any case."""

RELATED = 0.5
"""Correlation of two channels in a run from which its sign is that of the machine."""

LEAST = 100
"""Samples from which a correlation is one."""

CONSTANT = "and varies in the other runs; is the sensor connected and within its range"
"""What is asked of a channel that has one value in a run."""

EFFORTS, TINY = ("N", "N m", "A"), 1e-300
"""Units of what a machine that moves never holds exactly, and a divisor in place of zero."""

POSITIONS, MOTIONS = ("rad", "m"), ("rad", "m", "rad/s", "m/s", "rad/s^2", "m/s^2")
"""Units of which the rate counts, and those of motion: two motions may be independent."""


def in_another_unit(recordings: Sequence[Recording]) -> Iterator[str]:
    """Yield which channels are probably in another unit in some runs, in words.

    Such a channel varies far more or less there than in most runs, while another one varies as
    usual: where a machine rightly moves less, its drive does less, too. Where runs have all sizes,
    the noise from sample to sample is compared, and the ratio must be that of a unit or of ten: a
    faster motion has any. A condition that is as exceptional, such as no payload, explains a size.
    """
    runs: dict[tuple[str, str, str], list[tuple[str, float]]] = {}
    asked = set[tuple[str, str]]()
    for measure, how in ((_spread, ""), (_noise, " from sample to sample")):
        compared = _at_one_rate(recordings) if how else recordings
        for name, unit, run, ratio in _apart(compared, measure):
            if not how and _is_explained(name, run, ratio, recordings):
                continue
            if how and (_is_smooth(recordings, name, run) or not (unit or _is_of_ten(ratio))):
                continue
            if (name, run) not in asked:
                asked.add((name, run))
                runs.setdefault((name, unit, how), []).append((run, ratio))
    for (name, unit, how), places in runs.items():
        where = ", ".join(run for run, _ in places)
        if unit == CONSTANT:
            yield f"{name}: it is constant in {where}, {unit} there?"
            continue
        yield (
            f"{name}: it varies {places[0][1]:.3g} times as much{how} in {where} as in the other"
            f" runs, and other channels as usual;"
            f" {f'is it {unit}' if unit else 'are unit and gain right'} there?"
        )


def spoiled(recordings: Sequence[Recording], read: Collection[str]) -> dict[str, str]:
    """Return the runs that cannot be used as they are, each with what is wrong with it in words.

    A channel that is read surely has another unit there: its size and its noise are both beyond
    those of all other runs, and one of the two is so by far. Or a force, a torque or a current has
    one value there that is not zero: a machine that coasts has none.
    """
    runs: dict[tuple[str, str], dict[str, float]] = {}
    for measure in (_spread, _noise):
        compared = recordings if measure is _spread else _at_one_rate(recordings)
        for name, unit, run, ratio in _apart(compared, measure):
            if name in read and unit and not _is_explained(name, run, ratio, recordings):
                runs.setdefault((name, unit), {}).setdefault(run, ratio)
    found: dict[str, str] = {}
    for (name, unit), ratios in runs.items():
        own = [recording for recording in recordings if recording.name in ratios]
        rest = [recording for recording in recordings if recording.name not in ratios]
        if unit == CONSTANT:
            held = [r.name for r in own if unit_of(name) in EFFORTS and r[name][r.valid][0] != 0.0]
            found |= dict.fromkeys(held, f"{name} is constant there, and varies in the other runs")
        elif rest and _is_beyond(name, own, rest):
            found |= {
                run: f"{name} varies {ratio:.3g} times as much there as in the other runs, so it is"
                f" probably {unit}; correct the unit in it to use it"
                for run, ratio in ratios.items()
            }
    return found


def _is_beyond(name: str, own: Sequence[Recording], rest: Sequence[Recording]) -> bool:
    """Whether a channel's size and noise are both beyond those of other runs, one of them by far.

    A run that moves less, or faster, is beyond them in one of the two, or by little.
    """
    beyond = []
    for measure in (_spread, _noise):
        ours, others = ([measure(r, name) for r in runs] for runs in (own, rest))
        larger, smaller = min(ours) / max(*others, TINY), min(others) / max(*ours, TINY)
        beyond.append((larger, smaller))
    return any(min(gaps) > 1.0 and max(gaps) > FAR for gaps in zip(*beyond, strict=True))


def _is_explained(name: str, run: str, ratio: float, recordings: Sequence[Recording]) -> bool:
    """Whether a condition of a run is unusual, too, and most runs with it are not apart from it."""
    own = next(recording for recording in recordings if recording.name == run)
    for key, value in own.conditions.items():
        stated = [(r, r.conditions.get(key)) for r in recordings]
        numbers = [abs(one) for _, one in stated if isinstance(one, float)]
        if not isinstance(value, float) or len(numbers) < len(recordings):
            continue
        usual = float(np.median(numbers))
        if not (abs(value) < usual / ALIKE if ratio < 1.0 else abs(value) > usual * ALIKE):
            continue
        same = [
            _spread(r, name) for r, one in stated if one == value and r is not own and name in r
        ]
        if not same or _within(np.median(same), _spread(own, name), FAR):
            return True
    return False


def _at_one_rate(recordings: Sequence[Recording]) -> list[Recording]:
    """Return the runs about as fast sampled as most: a motion has larger steps at a lower rate."""
    recordings = [recording for recording in recordings if len(recording) > 1]
    rates = np.array([recording.sample_rate_hz for recording in recordings])
    usual = float(np.median(rates)) if rates.size else 0.0
    return [r for r, rate in zip(recordings, rates, strict=True) if _within(rate, usual, SURE)]


def _apart(
    recordings: Sequence[Recording], measure: Callable[[Recording, str], float]
) -> Iterator[tuple[str, str, str, float]]:
    """Yield channel, what its unit probably is or nothing, run, and ratio to the usual measure."""
    recordings = [recording for recording in recordings if recording.valid.any()]
    ratios = {}
    for name in shared_columns(recordings) if recordings else ():
        found = np.array([measure(recording, name) for recording in recordings])
        usual = np.nanmedian(found) if np.isfinite(found).any() else 0.0
        if unit_of(name) in CONFUSED and np.mean(_within(found, usual)) >= MOST:
            ratios[name] = found / usual
    noises = {n: _to_usual([_noise(r, n) for r in recordings]) for n in ratios}
    for k, recording in enumerate(recordings):
        known = {n: r[k] for n, r in ratios.items() if np.isfinite(r[k])}
        as_noisy = {n: r for n, r in known.items() if _within(noises[n][k], 1.0)}
        far = {
            n: ratio
            for n, ratio in known.items()
            # two that vary as little, with noise as usual: the run moves less
            if not _within(ratio, 1.0, FAR)
            and not (
                n in as_noisy and sum(_within(one, ratio, SURE) for one in as_noisy.values()) > 1
            )
        }
        if far and any(_within(r[k], 1.0) for r in ratios.values()):
            units = {n: _unit(n, ratio, ratios[n]) for n, ratio in far.items()}
            name = next((n for n in far if units[n]), next(iter(far)))
            yield name, units[name], recording.name, far[name]


def _to_usual(values: Sequence[float]) -> FloatArray:
    """Return values over their median; none where it is zero or not known."""
    found = np.array(values)
    usual = float(np.nanmedian(found)) if np.isfinite(found).any() else 0.0
    return found / usual if usual > 0.0 else np.full(len(found), np.nan)


def _spread(recording: Recording, name: str) -> float:
    """Return the standard deviation of a channel; exactly 0 of a constant one."""
    values = recording[name][recording.valid & np.isfinite(recording[name])]
    return float(np.std(values - values[0])) if values.size else np.nan


def _noise(recording: Recording, name: str) -> float:
    """Return the mean size of a channel's second differences; none of few samples."""
    values = recording[name][recording.valid & np.isfinite(recording[name])]
    return float(np.mean(np.abs(np.diff(values, 2)))) if values.size > 2 else np.nan


def _is_smooth(recordings: Sequence[Recording], name: str, run: str) -> bool:
    """Whether a channel of a run has next to no noise, such as a reference.

    Its second differences are then those of the motion: larger at twice the step, where those of
    noise are of one size.
    """
    own = next(recording for recording in recordings if recording.name == run)
    return bool(_noise(own.at(np.arange(0, len(own), 2)), name) > ALIKE * _noise(own, name))


def _within(values: ArrayLike, usual: float, factor: float = ALIKE) -> NDArray[np.bool_]:
    """Return which values are within a factor of the usual one."""
    sizes = np.asarray(values)
    return (sizes * factor > usual) & (sizes < factor * usual)


def _unit(name: str, ratio: float, ratios: FloatArray) -> str:
    """Return the wrong unit that explains a ratio, as far as other runs agree; or nothing."""
    if ratio == 0.0:
        return CONSTANT
    alike = ratios[_within(ratios, 1.0)]
    allowed = max(SURE, float(alike.max()), 1 / float(alike.min()))
    for unit in CONFUSED[unit_of(name)]:
        if (size := conversion(unit, name)) is None:
            continue
        if _within(ratio, size.factor, allowed):
            return f"stated in {unit} without being so"
        if _within(ratio, 1 / size.factor, allowed):
            return f"in {unit}"
    return ""


def _is_of_ten(ratio: float) -> bool:
    return ratio > 0.0 and bool(_within(ratio, 10.0 ** round(np.log10(ratio)), SURE))


def of_another_sign(recordings: Sequence[Recording]) -> Iterator[str]:
    """Yield which channels probably have the other sign in some runs, in words.

    Two channels that go together in most runs, such as a current and a torque, go against one
    another there. The channel is the one all whose relations are reversed, most of them if several
    are so; a position counts by its rate.
    """
    recordings = [recording for recording in recordings if recording.valid.any()]
    names = [n for n in shared_columns(recordings) if unit_of(n) in CONFUSED] if recordings else []
    if len(names) < 2:
        return
    found = np.array([_correlations(recording, names) for recording in recordings])
    is_motion = np.array([unit_of(name) in MOTIONS for name in names])
    known = np.abs(found) >= RELATED
    usual = np.sign(np.sum(np.sign(found) * known, axis=0))
    agrees = known & (np.sign(found) == usual)
    counted = (agrees.mean(axis=0) >= MOST) & ~np.outer(is_motion, is_motion)
    np.fill_diagonal(counted, val=False)
    runs: dict[tuple[str, str], list[str]] = {}
    for recording, holds, is_known in zip(recordings, agrees, known, strict=True):
        reversed_ = counted & is_known & ~holds
        wholly = reversed_.any(axis=1) & ~(counted & holds).any(axis=1)
        if wholly.any():
            place = int(np.argmax(np.where(wholly, reversed_.sum(axis=1) - 0.5 * is_motion, -1.0)))
            others = " and ".join(_moved(names[k]) for k in np.flatnonzero(reversed_[place]))
            runs.setdefault((names[place], others), []).append(recording.name)
    for (name, others), places in runs.items():
        yield (
            f"{name}: it goes against {others} in {', '.join(places)}, and in the other runs the"
            " other way; is a sign wrong there?"
        )


def _moved(name: str) -> str:
    """Return the name of a channel, or that a position counts by its motion."""
    return f"the motion of {name}" if unit_of(name) in POSITIONS else name


def _correlations(recording: Recording, names: Sequence[str]) -> FloatArray:
    """Return the correlation of each two channels, 0 where there is none."""
    if len(recording) < LEAST:
        return np.zeros((len(names), len(names)))
    columns = np.array([recording[name] for name in names])
    for place, name in enumerate(names):
        if unit_of(name) in POSITIONS:
            with np.errstate(invalid="ignore"):  # infinite where a cell was
                columns[place] = np.gradient(columns[place], recording.time_s)
    columns = columns[:, recording.valid & np.isfinite(columns).all(axis=0)]
    if columns.shape[1] < LEAST:
        return np.zeros((len(names), len(names)))
    columns -= columns.mean(axis=1, keepdims=True)
    size = np.sqrt(np.sum(columns**2, axis=1))
    columns = np.divide(columns, size[:, None], out=np.zeros_like(columns), where=size[:, None] > 0)
    return np.asarray(columns @ columns.T)
