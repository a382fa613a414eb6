"""Search for the effects that an arm's torque holds beyond a model: fit one path, test another.

Or effects are chosen on one path alone, so that another is untouched by the choice. The path is cut
into segments, at the same places of every period. Periods repeat, so a random split would leak.
Every other segment is fitted and the rest is the test, and back.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from estimation.arm.base import base_of
from estimation.arm.effects import ArmEffect, row_count
from estimation.arm.identification import smoothed
from estimation.arm.motion import FINE, LOW_PASS, joint_channels, motion_of
from estimation.arm.regressor import regressor
from estimation.arm.signed import Block, Normal, Products, solve
from estimation.arm.tables import PSM, PSM_CLOSED
from estimation.arm.wrist import candidates, gripper
from estimation.diagnosis.split import SplitError, period_samples
from estimation.filters import zero_phase
from estimation.recording import FloatArray, Recording
from rig.errors import DataError, UsageError
from rig.importers.registry import open_campaign

EDGE_S = 1.0
"""Left out at either end: the filters' transients, and elements that have not slipped yet."""

RATE_SHARE = 10.0
"""Samples kept a second, in cutoffs of the torque's filter."""

DAMPING = 1e-3
"""Of the fits with effects: their columns are many and nearly collinear on one path."""

LEAST_GAIN = 0.005
"""Mean relative gain over the joints below which the search stops."""

STRETCHES = 8
"""Of a period: each is longer than the filter's memory, and half of them cover most of the
range."""

GRIPPER_SHARE = 0.3
"""Weight of the gripper's own torque: it helps to identify the wrist's drives and is not scored."""


def open_paths(data: Path, names: Sequence[str]) -> list[Recording]:
    """Read runs of a folder by name.

    Raises:
        UsageError: There is nothing at the path, or a run is named twice.
        DataError: A run is missing or cannot be read.
    """
    if len(set(names)) < len(names):
        raise UsageError(
            f"A run is named twice among {', '.join(names)}.",
            "A run that a model was fitted on does not test it.",
            "Name different runs.",
        )
    campaign = open_campaign(data)
    missing = [name for name in names if name not in campaign.names]
    if missing:
        raise DataError(
            f"{data} holds no run {' and no run '.join(missing)}.",
            f"It holds: {', '.join(campaign.names) or 'nothing'}.",
            "Name runs that it holds.",
        )
    return [campaign.select([name]).runs[0].recording() for name in names]


@dataclass(frozen=True)
class Trial:
    """One effect that the search tried."""

    effect: str
    what: str
    kept_in_round: int | None  # round of the search that kept it, from 1; None if dropped
    # mean relative gain over the joints, on the test path of the search: in the round that kept it,
    # else in the last round
    gain_percent: float
    other_way_percent: float  # the same in the direction that was not chosen on


@dataclass(frozen=True)
class Prepared:
    """One path, ready to be fitted or tested on: filtered, cut, thinned."""

    name: str  # of the run
    torque: FloatArray  # filtered torque, shape (n, rows): joints, then the gripper
    thesis: FloatArray
    """Base columns of filtered motion, as the thesis makes them, (n, joints, base)."""
    closed: FloatArray  # the same of the arm with its loops
    table: FloatArray  # filtered columns of barely filtered motion: the base, then every candidate
    blocks: tuple[Block, ...]  # which columns of the table belong to what; the base first
    independent_share: float  # share of its samples that are independent after the filter

    @property
    def joints(self) -> int:
        """Number of joints, the gripper not among them."""
        return int(self.thesis.shape[1])

    @property
    def filtered(self) -> FloatArray:
        """The thesis' base columns, filtered as the torque is; shape (n, joints, base)."""
        return self.table[:, : self.joints, : self.thesis.shape[2]]

    @cached_property
    def products(self) -> Products:
        """Cross-products of the whole table."""
        return Products.of(self.table, self.torque)

    @cached_property
    def normal(self) -> Normal:
        """Cross-products of the whole table, weighed."""
        return Normal.of(self.products, self.weights)

    @property
    def weights(self) -> FloatArray:
        """The thesis' weight of each joint, equation 2.11, and the gripper's smaller one."""
        largest = np.abs(self.torque).max(axis=0)
        weights = np.divide(1.0, largest, out=np.zeros_like(largest), where=largest > 0)
        weights[self.joints :] *= GRIPPER_SHARE
        return np.asarray(weights)

    def of(self, kept: Sequence[str]) -> list[Block]:
        """Return the blocks of the base and of some effects."""
        named = {block.name: block for block in self.blocks}
        return [self.blocks[0], *(named[name] for name in kept)]

    def values(self, kept: Sequence[str]) -> FloatArray:
        """Return the parameters of the base and of some effects that fit this path."""
        return solve(self.normal, self.of(kept))

    def nrmsd_percent(self, kept: Sequence[str], values: FloatArray) -> FloatArray:
        """Return the error of each joint on this path with parameters of any path, %."""
        at = np.concatenate([block.at for block in self.of(kept)])
        spread = np.ptp(self.torque[:, : self.joints], axis=0)
        return np.asarray(100 * self.products.rms(at, values)[: self.joints] / spread)

    def estimate(self, kept: Sequence[str], values: FloatArray) -> FloatArray:
        """Return the torque of the joints with parameters of any path, shape (n, joints)."""
        at = np.concatenate([block.at for block in self.of(kept)])
        return self.table[:, : self.joints][:, :, at] @ values


def prepare(
    recording: Recording, tried: Sequence[ArmEffect] | None = None, damping: float = DAMPING
) -> Prepared:
    """Filter one path and make its columns, of all effects worth trying unless some are given.

    The damping of its fits is a share of a column's squared length.

    Raises:
        DataError: The run is too short, or lacks a joint.
        ArmError: It holds no joints of the arm.
    """
    rate_hz = recording.sample_rate_hz
    position, _, torque = joint_channels(recording)
    edge, rows = round(EDGE_S * rate_hz), row_count(PSM)
    if len(position) < 4 * edge:
        raise DataError(
            f"Run {recording.name!r} is too short to identify an arm.",
            f"{len(position) / rate_hz:.3g} s, of which {EDGE_S} s at either end are left out.",
        )
    if position.shape[1] < rows:
        raise DataError(
            f"Run {recording.name!r} holds {position.shape[1]} joints, of {rows} needed.",
            "The wrist's motors are known only with the gripper's position.",
        )
    base = base_of(PSM)
    every = max(1, round(rate_hz / (RATE_SHARE * LOW_PASS.cutoff_hz)))
    kept = slice(edge, len(position) - edge, every)
    fine, coarse = motion_of(position, 1 / rate_hz, FINE), motion_of(position, 1 / rate_hz)
    effects = candidates(PSM) if tried is None else tried
    own = regressor(PSM, fine)[:, :, base.columns]
    padded = np.pad(own, ((0, 0), (0, rows - own.shape[1]), (0, 0)))
    parts = [padded, gripper(PSM, fine), *(effect.columns(fine) for effect in effects)]
    own_block = base_block(damping, [False, True, True, True][: parts[1].shape[2]])
    return Prepared(
        name=recording.name,
        torque=zero_phase(torque[:, :rows], rate_hz, LOW_PASS)[kept],
        thesis=regressor(PSM, coarse)[kept][:, :, base.columns],
        closed=regressor(PSM_CLOSED, coarse)[kept][:, :, base_of(PSM_CLOSED).columns],
        table=np.concatenate([smoothed(part, rate_hz)[kept] for part in parts], axis=2),
        blocks=blocks_of(own_block, effects, [part.shape[2] for part in parts[2:]], damping),
        independent_share=min(1.0, 2 * LOW_PASS.cutoff_hz * every / rate_hz),
    )


def base_block(damping: float, further: Sequence[bool] = ()) -> Block:
    """Return the block of an arm's base columns, frictions bounded.

    `further` states of each column behind those of the arm whether it is a friction.
    """
    friction = [name.startswith("F") and len(name) == 3 for name in base_of(PSM).names]
    bounded = np.array([*friction, *further])
    return Block("base", np.arange(len(bounded)), bounded, damping, own_length=True)


def blocks_of(
    base: Block, effects: Sequence[ArmEffect], widths: Sequence[int], damping: float = DAMPING
) -> tuple[Block, ...]:
    """Return the blocks of declared columns and of effects, each of so many columns."""
    blocks = [base]
    start = len(base.at)
    for effect, width in zip(effects, widths, strict=True):
        signs = np.full(width, effect.dissipative)
        at = np.arange(start, start + width)
        blocks.append(Block(effect.name, at, signs, damping * effect.damping))
        start += width
    return tuple(blocks)


def of_columns(
    name: str, torque: FloatArray, table: FloatArray, blocks: tuple[Block, ...], joints: int
) -> Prepared:
    """Return a path of columns that were made elsewhere, ready to be fitted or searched.

    Torque is of shape (n, rows), of which the first `joints` are scored; the table, (n, rows,
    columns), holds the base, then every candidate, as in the blocks.
    """
    none = table[:, :joints, :0]
    return Prepared(name, torque, none, none, table, blocks, 1.0)


def search(
    there: tuple[Prepared, Prepared],
    back: tuple[Prepared, Prepared],
    tried: Sequence[ArmEffect],
    on_round: Callable[[int], None] = lambda number: None,
) -> tuple[list[Trial], list[str]]:
    """Add effects one by one, while one helps on the path that was not fitted.

    Effects are chosen `there`, from a path to fit to a path to test on; one that does not help in
    the other direction is left out. `on_round` is called with the number of each round. Returns
    what became of each candidate, kept ones first, and the names of those kept in order.
    """
    kept: list[str] = []
    trials: list[Trial] = []
    unconfirmed: list[Trial] = []
    rest = list(tried)
    while rest:
        on_round(len(kept) + 1)
        gains = _gains(there, kept, rest)
        best = int(np.argmax(gains))
        if gains[best] < LEAST_GAIN:
            break
        effect = rest.pop(best)
        confirmed = float(_gains(back, kept, [effect])[0])
        if confirmed <= 0:
            unconfirmed.append(_trial(effect, None, gains[best], confirmed))
            continue
        trials.append(_trial(effect, len(kept) + 1, gains[best], confirmed))
        kept.append(effect.name)
    dropped = zip(rest, _gains(there, kept, rest), _gains(back, kept, rest), strict=True)
    return [
        *trials,
        *unconfirmed,
        *(_trial(e, None, one, other) for e, one, other in dropped),
    ], kept


def _gains(
    way: tuple[Prepared, Prepared], kept: Sequence[str], tried: Sequence[ArmEffect]
) -> list[float]:
    """Return the mean relative gain over the joints of one more effect; joints count alike."""
    before = score(way, kept)
    return [float(np.mean(1 - score(way, [*kept, e.name]) / before)) for e in tried]


def score(way: tuple[Prepared, Prepared], kept: Sequence[str]) -> FloatArray:
    """Return the error of each joint on the second path after a fit on the first, %."""
    one, other = way
    return other.nrmsd_percent(kept, one.values(kept))


def _trial(effect: ArmEffect, kept_in_round: int | None, one: float, other: float) -> Trial:
    return Trial(effect.name, effect.what, kept_in_round, 100 * one, 100 * other)


def period_of(run: Recording) -> float | None:
    """Return the period of a run's motion in samples of a prepared path; None if it has none."""
    try:
        seconds = period_samples(run) / run.sample_rate_hz
    except SplitError:
        return None
    return seconds * RATE_SHARE * LOW_PASS.cutoff_hz


def chosen_within(path: Prepared, run: Recording, tried: Sequence[ArmEffect]) -> list[str]:
    """Return the effects that help from some stretches of a run's path to the others and back."""
    samples = np.arange(len(path.torque))
    period = period_of(run) or len(samples)
    first = np.floor(samples / period * STRETCHES) % 2 == 0
    arrays = ("torque", "thesis", "closed", "table")
    one, other = (
        replace(path, **{name: getattr(path, name)[kept] for name in arrays})
        for kept in (first, ~first)
    )
    return search((one, other), (other, one), tried)[1]
