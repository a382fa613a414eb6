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
from estimation.diagnosis.instruments import projection, stand_in
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
        falls: Of each twin so far the catalogue's largest fall of mean squared error, and the
            largest share of it that any candidate removes.
    """

    twin: Twin
    model: Model
    pool: Sequence[Candidate]
    channels: Sequence[str]
    level: float
    mapper: Mapper = map
    falls: list[tuple[float, float]] = field(default_factory=list)

    def p_value(self, fall: float, share: float) -> float:
        """Return the larger p-value of a fall and of its share of the error it falls from.

        What noise makes is so large, whatever else is missing; what filters make is such a share
        of the error. At most `MOST` twins are made, and `LEAST` where it may pass.
        """
        while not self._decided(fall, share):
            seeds = range(len(self.falls), len(self.falls) + BATCH)
            work = partial(largest_fall, self.twin, self.model, self.pool, self.channels)
            self.falls += list(self.mapper(work, seeds))
        return max(self._p(0, fall), self._p(1, share))

    def _above(self, k: int, value: float) -> int:
        return sum(found[k] >= value for found in self.falls)

    def _p(self, k: int, value: float) -> float:
        above = self._above(k, value)
        if above == 0 and (tail := self._tail(k, value)) < CLEAR:
            return tail
        return (1 + above) / (1 + len(self.falls))

    def _decided(self, fall: float, share: float) -> bool:
        done = len(self.falls)
        worst = max(self._above(0, fall), self._above(1, share))
        if (1 + worst) / (1 + MOST) > self.level:
            return True
        if done < LEAST:
            return False
        won = (1 + worst) / (1 + done) <= self.level
        clear = worst == 0 and max(self._tail(0, fall), self._tail(1, share)) < CLEAR
        return won or clear or done >= MOST

    def _tail(self, k: int, value: float) -> float:
        """Return the tail probability of a Gumbel law through what was found: maxima."""
        found = np.array([pair[k] for pair in self.falls])
        spread = float(np.std(found, ddof=1)) * math.sqrt(6) / math.pi
        middle = float(np.mean(found)) - 0.5772 * spread
        if spread <= 0:
            return 1.0
        return float(-np.expm1(-np.exp(-min((value - middle) / spread, 700.0))))


def largest_fall(
    twin: Twin, model: Model, pool: Sequence[Candidate], channels: Sequence[str], seed: int
) -> tuple[float, float]:
    """Return the largest fall of mean squared error the catalogue reaches on one twin.

    And the share of that error that falls.

    Args:
        twin: Makes a campaign.
        model: Fitted declared model.
        pool: The catalogue's candidates.
        channels: Channels to prepare.
        seed: Seed of the twin.
    """
    runs = [coarse(prepare(recording, channels, model)) for recording in twin(seed)]
    told, standing = projection(runs, pool, model.target), stand_in(runs, model.target)
    balance: Balance = lay_out(model, [told(standing(run)) for run in runs])
    table = tables(balance.runs, pool, balance.demean)
    aims = [r[:, None] for r in balance.left(balance.terms)]
    sizes = [len(c.effect.amplitudes) for c in pool]
    losses = leave_one_run_out(balance.base(balance.terms), table, sizes, aims)
    fall = losses.base.sum() - losses.joint[:, :, 0].sum(axis=0).min()
    return float(fall) / sum(len(y) for y in balance.target), float(fall / losses.base.sum())


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
