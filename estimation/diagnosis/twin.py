"""The parametric bootstrap: what the whole search finds where nothing is missing.

A twin is a simulated campaign of the declared model with the same references and sensors. It holds
every artefact of filters, sensors and feedback, which no shuffling of a residual does.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from estimation.diagnosis.balance import Balance, lay_out
from estimation.diagnosis.candidate import Candidate
from estimation.diagnosis.design import Mapper, Run, prepare, tables
from estimation.diagnosis.evidence import leave_one_run_out
from estimation.diagnosis.instruments import projection
from estimation.model import Model
from estimation.recording import Recording

Twin = Callable[[int], Sequence[Recording]]
"""Seed to one simulated campaign of the declared model: the discovery runs, nothing missing."""

BATCH = 4
LEAST = 12
MOST = 100
CLEAR = 1e-3
"""A tail probability so small that more twins decide nothing."""

COARSE = 5
"""Columns of twins are made from channels thinned by this much before they are decimated: the
channels hold nothing above the model's filter, and the work falls with the samples."""


@dataclass
class Bootstrap:
    """P-values of falls of error under the twin; simulates as many as a decision needs.

    Attributes:
        twin: Makes a campaign.
        model: Fitted declared model.
        pool: The catalogue's candidates.
        channels: Channels to prepare.
        level: P-value that decides.
        mapper: Maps over seeds; an executor's makes it parallel, then `twin` must be picklable.
        falls: Largest fall of mean squared error of each twin so far.
    """

    twin: Twin
    model: Model
    pool: Sequence[Candidate]
    channels: Sequence[str]
    level: float
    mapper: Mapper = map
    falls: list[float] = field(default_factory=list)

    def p_value(self, fall: float) -> float:
        """Return the p-value of a fall; at most `MOST` twins, and `LEAST` where it may pass."""
        while not self._decided(fall):
            seeds = range(len(self.falls), len(self.falls) + BATCH)
            work = partial(largest_fall, self.twin, self.model, self.pool, self.channels)
            self.falls += list(self.mapper(work, seeds))
        return self._p(fall)

    def _p(self, fall: float) -> float:
        above = sum(f >= fall for f in self.falls)
        if above == 0 and (tail := self._tail(fall)) < CLEAR:
            return tail
        return (1 + above) / (1 + len(self.falls))

    def _decided(self, fall: float) -> bool:
        done = len(self.falls)
        above = sum(f >= fall for f in self.falls)
        if (1 + above) / (1 + MOST) > self.level:
            return True
        if done < LEAST:
            return False
        won = (1 + above) / (1 + done) <= self.level
        return won or (above == 0 and self._tail(fall) < CLEAR) or done >= MOST

    def _tail(self, fall: float) -> float:
        """Return the tail probability of a Gumbel law through the falls: they are maxima."""
        spread = float(np.std(self.falls, ddof=1)) * math.sqrt(6) / math.pi
        middle = float(np.mean(self.falls)) - 0.5772 * spread
        if spread <= 0:
            return 1.0
        return float(-np.expm1(-np.exp(-min((fall - middle) / spread, 700.0))))


def largest_fall(
    twin: Twin, model: Model, pool: Sequence[Candidate], channels: Sequence[str], seed: int
) -> float:
    """Return the largest fall of mean squared error the catalogue reaches on one twin.

    Args:
        twin: Makes a campaign.
        model: Fitted declared model.
        pool: The catalogue's candidates.
        channels: Channels to prepare.
        seed: Seed of the twin.
    """
    runs = [coarse(prepare(recording, channels, model)) for recording in twin(seed)]
    told = projection(runs, pool, model.target)
    balance: Balance = lay_out(model, [told(run) for run in runs])
    table = tables(balance.runs, pool, balance.demean)
    aims = [r[:, None] for r in balance.left(balance.terms)]
    sizes = [len(c.effect.amplitudes) for c in pool]
    losses = leave_one_run_out(balance.base(balance.terms), table, sizes, aims)
    fall = losses.base.sum() - losses.joint[:, :, 0].sum(axis=0).min()
    return float(fall) / sum(len(y) for y in balance.target)


def coarse(run: Run) -> Run:
    """Return a run with `COARSE` times fewer samples, where its decimation allows it."""
    if run.down % COARSE:
        return run
    every = slice(None, None, COARSE)
    return replace(
        run,
        channels={name: np.ascontiguousarray(x[every]) for name, x in run.channels.items()},
        valid=run.valid[every],
        moving=run.moving[every],
        down=run.down // COARSE,
    )
