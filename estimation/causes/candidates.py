"""The candidate causes of a search, laid out on the runs."""

import itertools
import math
from collections import Counter
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from estimation.causes.blocks import Block, block_of
from estimation.causes.functions import MOST_VARIABLES, Function, functions_at
from estimation.causes.instruments import signal
from estimation.causes.joint import Joint
from estimation.causes.laid import NOTHING, Columns, Laid, Scale
from estimation.causes.layout import Layout
from estimation.causes.offered import sources_at
from estimation.causes.places import places_of
from estimation.causes.run_signals import RunSignals
from estimation.causes.sources import Source
from estimation.recording import FloatArray

QUIET = 0.002
"""Noise of a channel over its range below which no column follows it."""

AT_ONCE = 40_000
"""Causes times squared columns in one group: keeps its memory small."""


@dataclass(frozen=True)
class Claim:
    """A cause and the runs in which it acts.

    Attributes:
        cause: The named effect or smooth function.
        acts: Whether it acts in each run; in all when None.
        choices: Forms that share the prior probability of a cause, times the points of its grid.
        given: Whether the runs in which it acts were not chosen: those of one campaign.
    """

    cause: Source | Function
    acts: tuple[bool, ...] | None = None
    choices: int = 1
    given: bool = False

    @property
    def name(self) -> tuple[str, str, tuple[str, ...]]:
        """What is claimed: place, family, and the variables of a function."""
        variables = self.cause.variables if isinstance(self.cause, Function) else ()
        return self.cause.place.name, self.cause.family, variables

    @property
    def is_function(self) -> bool:
        """Whether its form is unknown."""
        return isinstance(self.cause, Function)

    def has_means(self, joint: Joint) -> bool:
        """Whether the means of the runs show it.

        Where runs have offsets of their own, what starts between runs also shifts their means, by
        its own offset; another factor of a declared term shifts them as the term does.
        """
        own = any(map(joint.has_offsets, self.cause.place.equations))
        return self.acts is None or self.given or self.cause.is_declared or not own


@dataclass(frozen=True, kw_only=True)
class Candidate(Claim):
    """A claim laid out on the runs.

    Attributes:
        laid: Its columns of every run, without what the declared columns explain.
        precision: Prior precision of every amplitude.
    """

    laid: Laid
    precision: FloatArray

    @property
    def size(self) -> FloatArray:
        """What its columns were divided by, shape (k,)."""
        return np.asarray(self.laid.size[0])


OfRuns = Sequence[Mapping[str, FloatArray]]
"""Columns of every run: equation to (samples, k)."""

Raw = tuple[Claim, OfRuns, OfRuns | None]
"""A claim, its columns in every run, and those of the shaken runs where it follows noise."""


@dataclass(frozen=True)
class Group:
    """Candidates of one place with as many columns each, laid out together.

    The prior precision of their amplitudes has the shape (candidates, k); the block is their
    products with the regression that they were laid out for.
    """

    candidates: Sequence[Candidate]
    laid: Laid
    precision: FloatArray
    block: Block | None = None

    def only(self, chosen: NDArray[np.intp]) -> "Group":
        """Return some of the candidates, without their products."""
        kept = [self.candidates[int(k)] for k in chosen]
        return Group(kept, self.laid.only(chosen), self.precision[chosen])

    def within(self, equations: Container[str]) -> "Group":
        """Return the same candidates as if they entered some of the equations only."""
        return replace(self, laid=self.laid.within(equations), block=None)


def every_claim(layout: Layout) -> Iterator[Claim]:
    """Yield every cause that a diagnosis tries, those of one place after one another."""
    for place in places_of(layout):
        yield from map(Claim, sources_at(layout, place))
        yield from map(Claim, functions_at(layout, place))


def candidates(joint: Joint) -> list[Group]:
    """Return every candidate cause, laid out."""
    return pool_of(joint, every_claim(joint.layout))


def pool_of(joint: Joint, claims: Iterable[Claim]) -> list[Group]:
    """Return claims laid out, each with the number of choices that it is one of."""
    train, pool = joint.layout, list[Group]()
    for _, at_one in itertools.groupby(claims, lambda one: one.cause.place.name):
        pool += groups_of(joint, at_one)
    for run in (*train.runs, *train.shaken):
        run.memo.clear()  # columns of the whole run, many times as large as those on the grid
    causes = [c.cause for group in pool for c in group.candidates]
    points = Counter(_form(cause) for cause in causes if not _tried(cause))
    return [
        replace(
            group,
            candidates=[replace(c, choices=_choices(c.cause, points)) for c in group.candidates],
            block=block_of(joint, group.laid),
        )
        for group in pool
    ]


def _tried(cause: Source | Function) -> int:
    """Return the number of points that stand behind one candidate; 0 where each is one."""
    return cause.tried if isinstance(cause, Source) else 0


def _form(cause: Source | Function) -> tuple[str, object]:
    """Return the place of a cause, and its effect or variables: it is one at several points."""
    form = cause.variables if isinstance(cause, Function) else cause.effect.id
    return cause.place.name, form


def _choices(cause: Source | Function, points: Mapping[tuple[str, object], int]) -> int:
    """Return the number of choices that a cause is one of: of forms, and within its form.

    Within a form these are the points of its grid, or those that it was chosen from. The smooth
    functions of a place are one form; within it these are the numbers of variables, the sets of so
    many, and the points of their grid.
    """
    variables = Counter(place for place, of in points if isinstance(of, tuple) and len(of) == 1)
    forms = sum(isinstance(of, str) for _, of in points) + len(variables)
    own = points[_form(cause)]
    if not isinstance(cause, Function):
        return forms * (cause.tried or own)
    sets = max(1, math.comb(variables[cause.place.name], len(cause.variables)))
    return forms * MOST_VARIABLES * sets * own


def groups_of(joint: Joint, wanted: Iterable[Claim]) -> list[Group]:
    """Return causes laid out; those that show nowhere are left out."""
    out: list[Group] = []
    waiting: dict[object, list[Raw]] = {}
    for one in wanted:
        if (columns := _columns(one, joint.runs)) is None:
            continue
        noisy = _is_noisy(joint.layout, one)
        shaken = _columns(one, joint.layout.shaken) if noisy else None
        width = next(iter(columns[0].values())).shape[1]
        key = (tuple(columns[0]), width, _unit(one.cause), one.has_means(joint), shaken is None)
        held = waiting.setdefault(key, [])
        held.append((one, columns, shaken))
        if len(held) * width**2 >= AT_ONCE:
            out += _laid(joint, waiting.pop(key))
    for held in waiting.values():
        out += _laid(joint, held)
    return out


def laid_out(joint: Joint, claim: Claim) -> Candidate | None:
    """Return a cause laid out on the runs of a regression; None where it shows nowhere."""
    groups = groups_of(joint, [claim])
    return groups[0].candidates[0] if groups else None


def as_read(joint: Joint, candidate: Candidate) -> Laid | None:
    """Return a cause of readings in the unit of, and less as much declared as, a laid out one."""
    cause = replace(candidate.cause, as_read=True)
    read = _columns(Claim(cause, candidate.acts), joint.runs)
    known = _columns(candidate, joint.runs)
    if read is None or known is None:
        return None
    laid, size = candidate.laid, candidate.laid.size
    inners, middles = {}, {}
    for name, (inner, means) in _stacked(joint, [read], [known]).items():
        inners[name] = laid.inner[name] + inner / size[:, None]
        shifts = means / size if candidate.has_means(joint) else 0.0 * means
        middles[name] = laid.means[name] + shifts
    return replace(laid, inner=inners, means=middles)


def _columns(one: Claim, runs: Sequence[RunSignals]) -> list[Mapping[str, FloatArray]] | None:
    """Return a cause's columns of every run; None where one is not finite."""
    columns = []
    for k, run in enumerate(runs):
        if (own := one.cause.columns(run)) is None:
            return None
        if one.acts is not None and not one.acts[k]:
            own = {name: np.zeros_like(values) for name, values in own.items()}
        columns.append(own)
    return columns


def _laid(joint: Joint, held: Sequence[Raw]) -> Iterator[Group]:
    first = held[0][0]
    shaken = [raw[2] for raw in held if raw[2] is not None]
    columns = [raw[1] for raw in held]
    laid = without_declared(joint, columns, shaken, _unit(first.cause), first.has_means(joint))
    shown = np.flatnonzero(laid.size.min(axis=1) >= NOTHING)
    if len(shown) < len(held):
        laid = laid.only(shown)
    if len(shown):
        chosen = [held[int(c)][0] for c in shown]
        precision = np.array(
            [_precision(joint, c.cause, s) for c, s in zip(chosen, laid.size, strict=True)]
        )
        whole = [
            Candidate(
                one.cause,
                one.acts,
                one.choices,
                one.given,
                laid=laid.only(slice(c, c + 1)),
                precision=precision[c],
            )
            for c, one in enumerate(chosen)
        ]
        yield Group(whole, laid, precision)


def without_declared(
    joint: Joint,
    columns: Sequence[OfRuns],
    shaken: Sequence[OfRuns],
    unit: Scale,
    has_means: bool = True,
) -> Laid:
    """Return causes' columns, with those of the shaken runs or none, less the declared ones."""
    followed = _stacked(joint, shaken, columns)
    noise = {name: inner for name, (inner, _) in followed.items()}
    return joint.projection.laid(_stacked(joint, columns), noise, unit, has_means)


def _stacked(
    joint: Joint, columns: Sequence[OfRuns], less: Sequence[OfRuns] = ()
) -> dict[str, tuple[Columns, FloatArray]]:
    """Return equation to the columns of causes less others and each run's mean, and the means.

    Shapes (runs, causes, samples, k) and (runs, causes, k).
    """
    out = {}
    for name in columns[0][0] if columns else ():
        most, k = int(joint.samples[name, "within"].max()), columns[0][0][name].shape[1]
        inner = np.zeros((len(joint.runs), len(columns), most, k), dtype=np.float32)
        means = np.zeros((len(joint.runs), len(columns), k))
        for r in range(len(joint.runs)):
            own = np.stack([runs[r][name] for runs in columns])
            if less:
                own -= [runs[r][name] for runs in less]
            means[r] = own.mean(axis=1)
            inner[r, :, : own.shape[1]] = own - means[r][:, None]
        out[name] = inner, means
    return out


def _is_noisy(layout: Layout, claim: Claim) -> bool:
    """Whether what a cause reads, or its derivative in some equation, has noise that counts."""
    if not layout.shaken:
        return False
    if any(entry.order for entry in claim.cause.place.enters):
        return True
    names = {
        signal(layout.runs[0], channel, entry.equation)
        for channel in claim.cause.reads
        for entry in claim.cause.place.enters
    }
    return any(_noise_share(layout, name) > QUIET for name in names)


def _noise_share(layout: Layout, channel: str) -> float:
    """Return the noise of a channel over its range in all runs."""

    def share() -> FloatArray:
        values = [run.on_grid(channel) for run in layout.runs]
        noise = [
            float(np.mean((shaken.on_grid(channel) - own) ** 2))
            for shaken, own in zip(layout.shaken, values, strict=True)
        ]
        span = max(x.max() for x in values) - min(x.min() for x in values)
        return np.array(np.sqrt(np.mean(noise)) / (span or 1.0))

    return float(layout.runs[0].once(("noise share", channel), share))


def _unit(cause: Source | Function) -> Scale:
    if isinstance(cause, Function):
        return "none"
    return "first" if cause.bend else "each"


def _precision(joint: Joint, cause: Source | Function, size: FloatArray) -> FloatArray:
    """Return the prior precision of each amplitude.

    A named effect, scaled to norm one, is not larger than half of all signals; a smooth function's
    knots have a standard deviation of so many declared errors.
    """
    everything = np.full(len(size), 4.0 / joint.power)
    if isinstance(cause, Function):
        knot = [e.gain**2 / joint.error[e.equation, "within"] for e in cause.place.enters]
        return np.asarray(everything + np.mean(knot) / joint.numbers.knot_sd**2)
    if cause.bend is not None:
        everything[1:] += 1.0 / (cause.bend.sd * size[1:]) ** 2
    return everything
