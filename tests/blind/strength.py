"""How strong a strong case is: what an effect adds to what the declared model leaves.

python -m tests.blind.strength [NAME ...]

Prints for each effect and balance in which it shows the root mean square that the fitted declared
model leaves on the case's runs without the effect and with it. The rig is that of a strong case.
"""

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from estimation import model_file
from estimation.campaign import Campaign
from estimation.derived import measured_channels
from estimation.diagnosis.balance import lay_out
from estimation.diagnosis.design import prepare
from estimation.fitting import fit
from estimation.recording import Recording
from rig.simulation.hidden import HiddenEffect
from tests.blind.excitation import RUNS
from tests.blind.generate import Answer, record
from tests.blind.truths import TRUTHS

SOME = range(0, RUNS, 2)
"""Runs of every kind of motion."""


@dataclass(frozen=True)
class Shown:
    """What one effect adds in one balance.

    Attributes:
        name: The hidden effect.
        balance: The balance.
        without: Root mean square that the declared model leaves without it.
        with_it: The same with it.
    """

    name: str
    balance: str
    without: float
    with_it: float

    @property
    def share(self) -> float:
        """Share of the squared residual that the effect makes."""
        return 1.0 - (self.without / self.with_it) ** 2


def shown(name: str, runs: Sequence[int] = SOME) -> Iterator[Shown]:
    """Yield what an effect adds in each balance in which it shows.

    Args:
        name: The hidden effect.
        runs: Places of the runs that are played.
    """
    truth = TRUTHS[name]
    there = range(7, RUNS) if truth.course == "comes" else range(RUNS)
    plain = Answer("case-00000000", "control", (), tuple(there), truth.needs)
    hiding = Answer(
        plain.case, "strong", (HiddenEffect(name, truth.scale),), plain.runs, truth.needs
    )
    before, after = (list(record(answer, runs)) for answer in (plain, hiding))
    for balance in sorted(truth.balances):
        yield Shown(name, balance, left(balance, before), left(balance, after))


def left(balance: str, recordings: Sequence[Recording]) -> float:
    """Return the root mean square of what the shipped model of a balance leaves, fitted on runs."""
    declared = model_file.read(Path(balance))
    fitted = fit(declared, Campaign.of(recordings), bootstrap=0)
    names = [declared.target, *declared.channels]
    measured = [r for r in recordings if all(c in r for c in measured_channels(names))]
    whole = lay_out(fitted, [prepare(r, names, declared) for r in measured])
    return float(np.sqrt(np.mean(np.concatenate(whole.left(whole.terms)) ** 2)))


def main() -> None:
    """Print the table, one line an effect and balance."""
    for name in sys.argv[1:] or TRUTHS:
        for one in shown(name):
            sys.stdout.write(
                f"{name:26s} {one.balance:8s} {1e3 * one.without:7.3f} -> {1e3 * one.with_it:7.3f}"
                f"  share {one.share:5.2f}\n"
            )
            sys.stdout.flush()


if __name__ == "__main__":
    main()
