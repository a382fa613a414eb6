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
from estimation.diagnosis.design import Mapper, Run, prepare
from estimation.diagnosis.gates import Gates
from estimation.diagnosis.instruments import projection, stand_in
from estimation.diagnosis.search import Search
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
        gates: What an effect must pass; its chance is the p-value that decides.
        mapper: Maps over seeds; an executor's makes it parallel, then `twin` must be picklable.
        falls: Of each twin so far the catalogue's largest fall of mean squared error, and the
            largest share of it that any candidate removes.
    """

    twin: Twin
    model: Model
    pool: Sequence[Candidate]
    channels: Sequence[str]
    gates: Gates
    mapper: Mapper = map
    falls: list[tuple[float, float]] = field(default_factory=list)

    def p_value(self, fall: float, share: float) -> float:
        """Return the larger p-value of a fall and of its share of the error it falls from.

        What noise makes is so large, whatever else is missing; what filters make is such a share
        of the error. At most `MOST` twins are made, and `LEAST` where it may pass.
        """
        while not self._decided(fall, share):
            seeds = range(len(self.falls), len(self.falls) + BATCH)
            work = partial(
                largest_fall, self.twin, self.model, self.pool, self.channels, self.gates
            )
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
        if (1 + worst) / (1 + MOST) > self.gates.chance:
            return True
        if done < LEAST:
            return False
        won = (1 + worst) / (1 + done) <= self.gates.chance
        clear = worst == 0 and max(self._tail(0, fall), self._tail(1, share)) < CLEAR
        return won or clear or done >= MOST

    def _tail(self, k: int, value: float) -> float:
        """Return the tail probability of a Gumbel law through what was found: maxima."""
        found = np.array([pair[k] for pair in self.falls])
        spread = float(np.std(found, ddof=1)) * math.sqrt(6) / math.pi
        middle = float(np.mean(found)) - 0.5772 * spread
        if spread <= 0:  # as where no twin shows anything that the search would take
            return 0.0 if value > middle else 1.0
        return float(-np.expm1(-np.exp(-min((value - middle) / spread, 700.0))))


def largest_fall(
    twin: Twin,
    model: Model,
    pool: Sequence[Candidate],
    channels: Sequence[str],
    gates: Gates,
    seed: int,
) -> tuple[float, float]:
    """Return the fall of mean squared error of what the search takes first on one twin.

    And the share of that error that falls.

    Args:
        twin: Makes a campaign.
        model: Fitted declared model.
        pool: The catalogue's candidates.
        channels: Channels to prepare.
        gates: What keeps an effect from being taken: its signs, and a sensor's noise.
        seed: Seed of the twin.
    """
    runs = [coarse(prepare(recording, channels, model)) for recording in twin(seed)]
    told, standing = projection(runs, pool, model.target), stand_in(runs, model.target)
    balance: Balance = lay_out(model, [told(standing(run)) for run in runs])
    search = Search(balance, list(pool), gates)
    trial = search.largest()
    if trial is None:
        return 0.0, 0.0
    samples = sum(len(y) for y in balance.target)
    return trial.worth * search.declared_loss / samples, trial.gain


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
