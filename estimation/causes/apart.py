"""Runs in which one channel has a sign or a unit of its own next to the other runs."""

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimation.causes.equations import Equation
from estimation.causes.joint import Joint
from estimation.causes.laid import TINY
from estimation.causes.layout import Layout
from estimation.causes.numbers import Numbers
from estimation.derived import measured_channels
from estimation.diagnosis.split import Sealed
from estimation.recording import FloatArray
from estimation.unit_factors import unit_factor

FACTOR, UNEXPLAINED = 2.0, 0.1
"""Factor of the prediction of the other runs from which a run is remarked on, and the share of its
own variation that the factor may not explain. A run in which another effect dominates has more."""

LARGER, MINORITY = 2.0, 0.5
"""Factor by which the error of a run that is apart is larger than that of every other one, and the
share of runs that are fewer. Where the equation lacks an effect, its share of a slow or light run
appears as a factor."""

OF_A_UNIT = 0.1
"""Share by which the factor of a run may differ from that of two units."""


class Apart(NamedTuple):
    """A channel of a run that is a factor times what the other runs predict for it.

    `unexplained` is the share of the run's variation that the factor does not explain.
    """

    channel: str
    run: str
    factor: float
    unexplained: float


class _Factors(NamedTuple):
    """What some declared columns add to the prediction, and which factor of it is recorded.

    Attributes:
        channel: The channel that is multiplied: what they read, or the target.
        own: Their weights next to the others' zeros, shape (runs, parameters + 1).
        others: The target less what the other columns add, shape (runs, parameters + 1).
        is_target: Whether they are all columns.
    """

    channel: str
    own: FloatArray
    others: FloatArray
    is_target: bool

    def slopes(self, gram: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the factors if all error is in the one and in the other, shapes (runs,).

        The true one is between them. Noise of an acceleration is an error of the prediction, and
        in a slow run there is little else.
        """
        both = _products(self.own, gram, self.others)
        least = both / (_products(self.own, gram, self.own) + TINY)
        most = _products(self.others, gram, self.others) / np.where(both == 0.0, TINY, both)
        return least, most

    def is_far(self, gram: FloatArray) -> NDArray[np.bool_]:
        """Whether the factor is not about one, whichever of the two has the error, (runs,)."""
        least, most = self.slopes(gram)
        # of opposite sign to the prediction, both are below
        return np.asarray((most < 1.0 / FACTOR) | (least > FACTOR))

    def rest(self, gram: FloatArray) -> FloatArray:
        """Return the share of the variation that the factor does not explain, shape (runs,)."""
        least, most = self.slopes(gram)
        return np.asarray(1.0 - least / most)

    def left(self, gram: FloatArray) -> FloatArray:
        """Return the squared error next to the factor, in the unit of the other runs, (runs,)."""
        least, _ = self.slopes(gram)
        error = self.rest(gram) * _products(self.others, gram, self.others)
        return error / least**2 if self.is_target else error


def apart(joint: Joint) -> list[Apart]:
    """Return the runs of which one channel is not what the other runs predict.

    The factor is -1 where a sign is swapped, 57 where degrees were taken for radians. A run that is
    apart spoils the fit that the other runs are compared to: the one without which the others
    agree best is taken out first, and then the others are compared again.
    """
    # next to a run that is apart, a friction may be held at zero
    joint = joint.holding(np.zeros_like(joint.held))
    count, out = len(joint.runs), list[int]()
    while len(out) < (count - 1) // 2:
        found = {k for k, _ in _found(joint, out)} - {*out}
        if not found:
            break
        costs = {k: _cost(joint, [*out, k]) for k in sorted(found)}
        out.append(min(costs, key=costs.__getitem__))
    apart = [one for k, one in _found(joint, out) if k in out]
    return _of_readings(list(dict.fromkeys(apart)), joint.layout)


def _of_readings(found: Sequence[Apart], layout: Layout) -> list[Apart]:
    """Return the channels that are apart, without combinations where a reading explains the run.

    A difference of two angles appears reversed where the torque that it is compared with is.
    """
    read = {one.run for one in found if one.channel in layout.measured}
    return [one for one in found if one.channel in layout.measured or one.run not in read]


def wrong_runs(layout: Layout, sealed: Sealed, numbers: Numbers) -> list[Apart]:
    """Return the runs in which a channel has the opposite sign or another unit, before the search.

    Such a run spoils what is found in all others. The training runs are compared with one another,
    then the test runs with them.
    """
    train = [*filter(_is_wrong, apart(_joint(layout, sealed.discover, numbers)))]
    wrong = {one.run for one in train}
    rest = [name for name in (*sealed.discover, *sealed.confirm) if name not in wrong]
    found = filter(_is_wrong, apart(_joint(layout, rest, numbers)))
    return train + [one for one in found if one.run in sealed.confirm]


def _is_wrong(one: Apart) -> bool:
    """Whether minus one or a unit explains the run: with another factor it has other causes.

    A run of an arm whose equation lacks the motion of the other joints may appear reversed.
    """
    if one.factor < 0.0:
        return 1.0 / FACTOR < -one.factor < FACTOR
    return bool(unit_factor(one.factor, OF_A_UNIT))


def _joint(layout: Layout, names: Sequence[str], numbers: Numbers) -> Joint:
    return Joint(layout.select(names), numbers)


def _cost(joint: Joint, without: Sequence[int]) -> float:
    """Return the squared error of a fit without some runs, on the others."""
    vector = np.append(joint.left_out([without]).base[0], -1.0)
    kept = [k for k in range(len(joint.runs)) if k not in without]
    products = sum(joint.weights[p] * joint.gram[p][kept].sum(axis=0) for p in joint.parts)
    return float(vector @ products @ vector)


def _found(joint: Joint, out: Sequence[int]) -> Iterator[tuple[int, Apart]]:
    """Yield the place of each run that is apart from those that are neither it nor taken out."""
    base = joint.left_out([sorted({*out, k}) for k in range(len(joint.runs))]).base
    for name, equation in joint.layout.equations.items():
        within, samples = joint.gram[name, "within"], joint.samples[name, "within"]
        whole = within
        if not equation.model.run_offsets:
            whole = within + samples[:, None, None] * joint.gram[name, "between"]
        tried = [*_tried(joint, equation, base)]
        fits = np.array([_is_factor(one, whole, within) for one in tried])
        fits &= _is_large(np.asarray(fits.any(axis=0)), base, whole / samples[:, None, None])
        errors = np.where(fits, [one.left(whole) for one in tried], np.inf)
        for k in np.flatnonzero(fits.any(axis=0)).tolist():
            best = tried[int(np.argmin(errors[:, k]))]
            least, most = (float(slope[k]) for slope in best.slopes(whole))
            factor = math.copysign(math.sqrt(least * most), least)
            factor = factor if best.is_target else 1.0 / factor
            rest = float(best.rest(whole)[k])
            yield k, Apart(best.channel, joint.runs[k].name, factor, rest)


def _tried(joint: Joint, equation: Equation, base: FloatArray) -> Iterator[_Factors]:
    """Yield the target of an equation, then each measured channel of some of its columns."""
    ones = np.ones((len(base), 1))
    target = np.hstack([0.0 * base, ones])
    yield _Factors(equation.target, np.hstack([base, 0.0 * ones]), target, True)
    places = joint.at[equation.name, "within"]
    reads = [
        measured_channels(term.channels.values(), equation.model.signals)
        for term in equation.terms
        for _ in term.parameters
    ]
    whole = joint.whole(base)
    for channel in dict.fromkeys(names[0] for names in reads if len(names) == 1):
        at = [k for k, names in zip(places, reads, strict=False) if names == (channel,)]
        if len(at) == len(reads):
            continue
        own = np.zeros_like(target)
        own[:, at] = whole[:, at]
        yield _Factors(channel, own, np.hstack([-base, ones]) + own, False)


def _is_factor(tried: _Factors, whole: FloatArray, within: FloatArray) -> NDArray[np.bool_]:
    """Whether a run follows the prediction of the others times a factor not about one, (runs,).

    The run's mean alone does not show it, where the motion within the run has the usual factor.
    """
    least, largest = tried.slopes(within)
    usual = (least > 1.0 / FACTOR) & (largest < FACTOR)
    return np.asarray((tried.rest(whole) < UNEXPLAINED) & tried.is_far(whole) & ~usual)


def _is_large(fits: NDArray[np.bool_], base: FloatArray, gram: FloatArray) -> NDArray[np.bool_]:
    """Whether a run's error is larger than that of all others that are predicted as usual, (runs,).

    Each is predicted by the fit without the run. Where most appear apart, one spoils the others.
    """
    vector = np.hstack([-base, np.ones((len(base), 1))])
    squared = np.einsum("ki,rij,kj->kr", vector, gram, vector)
    others = ~np.eye(len(base), dtype=bool)
    if fits.mean() < MINORITY:
        others &= ~fits
    return np.asarray(squared.diagonal() > LARGER**2 * np.where(others, squared, 0.0).max(axis=1))


def _products(first: FloatArray, gram: FloatArray, second: FloatArray) -> FloatArray:
    """Return the product of two weighted sums of columns in each run, shape (runs,)."""
    return np.asarray(np.einsum("ri,rij,rj->r", first, gram, second))
