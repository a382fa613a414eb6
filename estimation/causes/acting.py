"""Causes of some of the runs: in which of them, and declared terms with another factor there."""

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimation.causes.blocks import Products
from estimation.causes.candidates import Candidate, Claim
from estimation.causes.instruments import estimated
from estimation.causes.joint import Joint
from estimation.causes.laid import centred
from estimation.causes.layout import Layout
from estimation.causes.places import Place, places_of
from estimation.causes.run_signals import EFFORTS, RunSignals
from estimation.causes.scoring import is_possible
from estimation.causes.sources import Source
from estimation.effects import effect
from estimation.fit_problem import OFFSET
from estimation.recording import FloatArray

PARTIAL, CHOICES = 24, 6
"""Names tried on some of the runs alone, and choices of runs of each."""

BETWEEN = {"campaign_clock", "condition"}
"""Roles of channels that state a run."""

TURNS = 4
"""Turns of fitting an effect to the runs that have it, and of choosing these runs."""


class Promise(NamedTuple):
    """A choice of some of the runs in which a named effect may act.

    Attributes:
        removed: Weighted error that it removes there.
        claim: The effect.
        acts: Whether it acts in each run, shape (runs,).
        amplitudes: Its amplitudes, in the scale of its columns, shape (k,).
    """

    removed: float
    claim: Claim
    acts: NDArray[np.bool_]
    amplitudes: FloatArray


def on_some_runs(joint: Joint, everything: Sequence[tuple[Claim, Products]]) -> list[Promise]:
    """Return choices of some of the runs in which named effects may act.

    What follows the time of the campaign or a condition states itself in which runs it acts.
    """
    count = len(joint.runs)
    if count < 6:
        return []
    inverse = joint.left_out([[]]).inverse[0]
    named: dict[int, list[tuple[Claim, Products]]] = {}
    for claim, by_run in everything:
        if isinstance(claim.cause, Source) and not BETWEEN & dict(claim.cause.channels).keys():
            named.setdefault(by_run.target.shape[1], []).append((claim, by_run))
    promises: list[Promise] = []
    for group in named.values():
        products = Products(*map(np.stack, zip(*(by_run for _, by_run in group), strict=True)))
        for acts in _acting(inverse, products):
            removed, amplitudes = _removed(inverse, *(_over(acts, x) for x in products))
            acting = acts.sum(axis=1)
            some = np.flatnonzero((acting > 1) & (acting < count))
            promises += [
                Promise(float(removed[k]), group[k][0], acts[k], amplitudes[k]) for k in some
            ]
    return promises


def most_promising(promises: Iterable[Promise]) -> list[Promise]:
    """Return the choices of runs that remove most, a few of each of the first names."""
    kept, seen = [], dict[object, set[tuple[bool, ...]]]()
    for promise in sorted(promises, key=lambda p: -p.removed):
        claim = promise.claim
        if claim.name not in seen and len(seen) == PARTIAL:
            continue
        size = claim.size if isinstance(claim, Candidate) else 1.0
        if not is_possible(claim.cause, promise.amplitudes / size):
            continue
        known, chosen = seen.setdefault(claim.name, set()), tuple(promise.acts.tolist())
        if len(known) < CHOICES and chosen not in known:
            known.add(chosen)
            kept.append(promise)
    return kept


def in_other_runs(candidate: Candidate) -> Iterator[Claim]:
    """Yield a cause of some runs with one run more or less, or a row of runs that are alike."""
    acts = candidate.acts or ()
    rows = [[*row] for _, row in itertools.groupby(range(len(acts)), key=acts.__getitem__)]
    for some in (*([k] for k in range(len(acts))), *(row for row in rows if len(row) > 1)):
        other = tuple(acting != (k in some) for k, acting in enumerate(acts))
        if 1 < sum(other) < len(acts):
            yield Claim(candidate.cause, other, candidate.choices)


def _acting(inverse: FloatArray, products: Products) -> Iterator[NDArray[np.bool_]]:
    """Yield choices of runs in which candidates act, shape (candidates, runs).

    Each order of the runs is cut where most error goes. From there, the amplitudes and the base are
    fitted to the runs that act, and the runs chosen again in which they lower the error, in turn.
    """
    base, own, cross = products
    candidates, count = cross.shape[:2]
    order = np.broadcast_to(np.arange(count), (candidates, count))
    sizes = np.argsort(_sizes(cross, own), axis=1)
    every = np.arange(candidates)[:, None]
    for runs in (order, order[:, ::-1], sizes, sizes[:, ::-1]):
        sums = [np.cumsum(x[every, runs], axis=1)[:, 1:-1] for x in products]
        cut = np.argmax(_removed(inverse, *sums)[0], axis=1)
        acts = np.zeros((candidates, count), dtype=np.bool_)
        acts[every, runs] = np.arange(count) < cut[:, None] + 2
        yield acts
        for _ in range(TURNS):
            across, square, right = (_over(acts, x) for x in products)
            through = inverse @ across
            fitted = solved(right, square - across.swapaxes(-1, -2) @ through)
            moved = -(through @ fitted[..., None])[..., 0]
            left = cross - np.einsum("crbk,cb->crk", base, moved)
            lower = 2.0 * left - np.einsum("crjk,ck->crj", own, fitted)
            acts = np.einsum("crk,ck->cr", lower, fitted) > 0.0
        yield acts


def _over(acts: NDArray[np.bool_], products: FloatArray) -> FloatArray:
    """Return the sum over the runs in which each candidate acts."""
    flat = products.reshape(*acts.shape, -1)
    summed = acts[:, None].astype(np.float64) @ flat
    return np.asarray(summed.reshape(len(acts), *products.shape[2:]))


def _sizes(cross: FloatArray, own: FloatArray) -> FloatArray:
    """Return the size of candidates in each run, of that in all runs, shape (candidates, runs).

    A run that shows little of a candidate is taken to have the size that all runs have.
    """
    everywhere = solved(cross.sum(axis=1), own.sum(axis=1))[:, None]
    shown = np.einsum("crj,crjk,crk->cr", everywhere, own, everywhere)
    apart = (everywhere * cross).sum(axis=-1) - shown
    return np.asarray(apart / (shown + 0.1 * shown.mean(axis=1, keepdims=True) + 1e-300))


def _removed(
    inverse: FloatArray, base: FloatArray, own: FloatArray, cross: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the error that amplitudes remove next to the base, shape (...,), and these amplitudes.

    The amplitudes have the shape (..., k).
    """
    amplitudes = solved(cross, own - base.swapaxes(-1, -2) @ inverse @ base)
    return (cross * amplitudes).sum(axis=-1), amplitudes


def solved(cross: FloatArray, own: FloatArray) -> FloatArray:
    """Return amplitudes from products (..., k) and (..., k, k)."""
    size = np.einsum("...kk->...", own)[..., None, None]
    steady = own + (1e-6 * size + 1e-300) * np.eye(own.shape[-1])
    return np.asarray(np.linalg.solve(steady, cross[..., None])[..., 0])


@dataclass(frozen=True)
class Moved(Source):
    """A declared term with another factor.

    Attributes:
        column: Number of its equation's declared column; None of an offset, and of the gain of a
            sensor that several equations read.
        of_all: Whether all terms of its equation differ alike.
    """

    column: int | None = None
    of_all: bool = False

    @property
    def is_declared(self) -> bool:
        """A declared term, or all; other offsets and gains are in no column."""
        return self.column is not None or self.of_all

    @property
    def is_bounded(self) -> bool:
        """A parameter moves either way."""
        return False

    @property
    def is_gain(self) -> bool:
        """Whether it is the gain of a sensor or of a drive, as a share of the usual one."""
        return self.effect.id == "sensor.gain" or self.of_all

    @property
    def side(self) -> int:
        """The sign of its term is in how it enters."""
        return 1

    def _names(self, run: RunSignals, equation: str) -> tuple[str, ...]:
        """Return the signals for its channels; for a target that of its equation's estimate.

        Unless other sensors predict it: the target's own reading would explain itself.
        """
        found = zip(super()._names(run, equation), self.channels, strict=True)
        own = [(n, estimated(c, equation) if n == c else n) for n, (_, c) in found]
        return tuple(estimate if estimate in run.channels else n for n, estimate in own)

    def change(self, amplitude: float, runs: Sequence[RunSignals]) -> float:
        """Return by how much the factor differs; of a gain, as a share of the usual one.

        A gain is fitted as a share of what stands for its reading in the equation.

        Args:
            amplitude: Of its column.
            runs: Those in which it acts.
        """
        if not self.is_gain:
            return amplitude
        (channel,), home = self.reads, self.place.home
        both = [
            [run.channels[name][run.grid[run.used[home]]] for run in runs]
            for name in (channel, *self._names(runs[0], home))
        ]
        read, stands = (np.concatenate([x - x.mean() for x in of_runs]) for of_runs in both)
        share = amplitude * float(stands @ stands) / float(read @ stands)
        return share if self.place.kind == "actuator" else share / (1.0 - share)

    def change_from_usual(self, amplitude: float) -> float:
        """Return by how much a gain differs whose column is what the usual one predicts.

        A drive that gives more torque an ampere takes less current.
        """
        return amplitude / (1.0 - amplitude) if self.place.kind == "actuator" else amplitude


def amplitudes_of(layout: Layout) -> Iterator[Moved]:
    """Yield every amplitude of the declared terms, offsets included, at its equation's place."""
    places = {place.name: place for place in places_of(layout)}
    for equation in layout.equations.values():
        own, column = places[equation.name], 0
        for term in equation.model.terms:
            own_effect, of_all_runs = term.effect, term.effect.id == OFFSET
            entries = [e for e in own.enters if e.equation == equation.name]
            signed = tuple(replace(entry, gain=float(term.sign)) for entry in entries)
            place = replace(own, enters=signed)
            channels = tuple((role, term.channels[role]) for role in own_effect.roles)
            shape = tuple(term.numbers(own_effect.shape))
            for k in range(len(own_effect.amplitudes)):
                at = None if of_all_runs else column + k
                yield Moved(place, own_effect, channels, shape, (k,), column=at)
            if not of_all_runs:
                column += len(own_effect.amplitudes) + len(own_effect.shape)


def gains_of(layout: Layout) -> Iterator[Moved]:
    """Yield the gains of drives that are targets, and of all sensors of a torque or a force.

    By that of a target which no other equation reads, all terms of its equation differ. That of
    another one which one equation reads is the factor of its declared term, by another name.
    """
    for place in places_of(layout):
        target, of_all = layout.equations[place.home].target, reads_target_alone(layout, place)
        if place.name == f"actuator {target}" and of_all and not target.endswith(EFFORTS):
            constant, source = effect("motor.torque_constant"), (("source", target),)
            yield Moved(place, constant, source, (), (0,), of_all=True)
        elif place.kind == "torque sensor":
            (reading,) = place.roles["reading"]
            of_several = of_all or len(place.enters) > 1
            column = None if of_several else _column_of(layout, place.home, reading)
            if of_several or column is not None:  # else it is a share of what a term reads
                gain, channels = effect("sensor.gain"), (("reading", reading),)
                yield Moved(place, gain, channels, (), (0,), column=column, of_all=of_all)


def _column_of(layout: Layout, equation: str, channel: str) -> int | None:
    """Return the number of the declared column that a channel is a constant times."""
    kinds = layout.equations[equation].kinds
    found = (k for k, kind in enumerate(kinds) if kind.channel == channel and not kind.of_shape)
    return next(found, None)


def reads_target_alone(layout: Layout, place: Place) -> bool:
    """Whether a place is that of the reading which is one equation's target and in no other."""
    target = layout.equations[place.home].target
    return len(place.enters) == 1 and target in place.roles.get("reading", ())


def moved_terms(joint: Joint) -> list[tuple[Claim, Products]]:
    """Return the declared terms as causes that act in no run yet, with their products by run.

    In all runs they are the base itself, so they compete only for acting in some. So do the gain
    of what reads the target, by which all terms differ alike, and that of a sensor which several
    equations read. An offset competes where the runs have none of their own.
    """
    usual, weights = joint.left_out([[]]).base[0], joint.weights
    out = []
    for one in (*amplitudes_of(joint.layout), *gains_of(joint.layout)):
        if one.effect.id == "sensor.gain" and not one.is_declared:
            out.append((Claim(one), _products(joint, one, usual)))
            continue
        is_offset = one.effect.id == OFFSET and not joint.has_offsets(one.place.home)
        if not (one.is_declared or is_offset):
            continue
        across, own = np.zeros((len(joint.runs), joint.size + 1)), np.zeros(len(joint.runs))
        for part in ((one.place.home, kind) for kind in ("within", "between")):
            terms, at = np.zeros(joint.size + 1), [*joint.at[part]]
            if is_offset:
                terms[joint.offset_at(one.place.home)] = one.place.enters[0].gain
            elif one.column is None:
                terms[at] = one.place.enters[0].gain * usual[at]
            else:
                terms[at[one.column]] = 1.0
            added = weights[part] * joint.gram[part] @ terms
            across += added
            own += added @ terms
        base = across[:, :-1, None]
        cross = across[:, -1:] - np.einsum("b,rbk->rk", usual, base)
        out.append((Claim(one), Products(base, own[:, None, None], cross)))
    return out


def _products(joint: Joint, one: Moved, usual: FloatArray) -> Products:
    """Return the products by run of what enters several equations; target: the base's residual."""
    columns = [one.columns(run) or {} for run in joint.runs]
    base, own = np.zeros((len(columns), joint.size, 1)), np.zeros((len(columns), 1, 1))
    cross = np.zeros((len(columns), 1))
    for name in one.place.equations:
        part = name, "within"
        inner, table = centred([of_run[name] for of_run in columns])[0], joint.tables[part]
        across = joint.weights[part] * table.swapaxes(-1, -2) @ inner
        base[:, [*joint.at[part]]] += across[:, :-1]
        own += joint.weights[part] * inner.swapaxes(-1, -2) @ inner
        cross += across[:, -1]
    return Products(base, own, cross - np.einsum("b,rbk->rk", usual, base))
