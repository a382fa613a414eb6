"""Calibrate the numbers of a diagnosis on campaigns drawn at random, and write the results page.

`python -m benchmarks.diagnosis.calibrate` diagnoses drawn campaigns whose seeds are kept for
calibration, with a cause and without. The numbers that weigh gains against choices are judged by
the mean log probability of the truth: in the training runs of the true family, or of no cause, and
of the true family in every finding. The page also states how often a clean campaign has a finding
in the end, and how often stated confidences are right. Resumes where it stopped.
"""

import argparse
import json
import math
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import beta

from benchmarks.rigs import CALIBRATE, draw
from estimation import model_file
from estimation.campaign import Campaign
from estimation.causes.findings import Probability
from estimation.causes.numbers import DEFAULT, Numbers
from estimation.causes.scoring import Price, Scored, probabilities
from estimation.causes.verdict import answer
from estimation.diagnosis.split import split
from estimation.files import write_text_atomic
from estimation.model import Model
from rig.output.provenance import commit

GEAR_RATIO = 35.0
"""Of all rigs: the derived channels of the reference rig are made for it."""

KINDS = ("strong", "weak", "outside", "pair")

SILENCED = "silenced"
"""A rig and protocol in which an effect would be confounded, without that effect."""

GRID = {
    "sharpness": (3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0, 16.0, 20.0),
    "cause_cost": (0.04, 0.06, 0.08, 0.1, 0.13, 0.16, 0.2),
    "rare_cost": (0.0, 0.04, 0.08, 0.12, 0.16, 0.2, 0.24),
    "choice_price": (0.0, 0.01, 0.02, 0.03, 0.04),
}
"""Number to the values that are compared."""

LEAST = 1e-3
"""Probability that a truth which was not considered is given."""

PAGE = Path("docs/results/diagnosis-numbers.md")


Row = tuple[str, float, float, int, float]
"""Family, gain, and what was chosen: choices, rare, amplitudes; see `Price`."""


@dataclass(frozen=True)
class Searched:
    """What a diagnosis came to.

    Attributes:
        name: The case.
        first: The best candidate of each family in the first place, on the training runs.
        findings: The same of each finding, on all runs; its family leads.
        families: True families, of each effect; none in a clean campaign.
    """

    name: str
    first: Sequence[Row]
    findings: Sequence[Sequence[Row]]
    families: Sequence[Sequence[str]]

    @property
    def known(self) -> set[str]:
        """Every true family."""
        return {family for effect in self.families for family in effect}

    def log_scores(self, numbers: Numbers) -> Iterator[float]:
        """Yield the log probability of the truth in the training runs, and in each finding."""
        shares = _shares(self.first, numbers)
        known = self.known
        right = (
            sum(p for f, p in shares.items() if f in known) if known else 1 - sum(shares.values())
        )
        yield math.log(max(right, LEAST))
        for one in self.findings:
            shares = _shares(one, numbers)
            right = sum(p for f, p in shares.items() if f in known)
            yield math.log(max(right, LEAST))

    def stated(self, numbers: Numbers) -> Iterator[tuple[float, bool]]:
        """Yield the confidence of each name, and whether it is right."""
        for one in self.findings:
            family, share = max(_shares(one, numbers).items(), key=lambda pair: pair[1])
            if family != "unknown":
                yield share, family in self.known


def _shares(rows: Sequence[Row], numbers: Numbers) -> dict[str, float]:
    """Return family to probability at some numbers; the rest to one is that of no cause."""
    if not rows:
        return {}
    gains = np.array([row[1] for row in rows])
    prices = [Price(choices, rare, more).score(numbers) for _, _, choices, rare, more in rows]
    shares = probabilities(gains - prices, gains, numbers.sharpness)
    return dict(zip((row[0] for row in rows), shares.tolist(), strict=True))


def main() -> int:
    """Calibrate."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.diagnosis.calibrate", description=__doc__
    )
    parser.add_argument("--cases", type=int, default=30, help="of each class with a cause")
    parser.add_argument("--clean", type=int, default=100, help="without a cause")
    parser.add_argument("--seed", type=int, default=CALIBRATE.start, help="first seed")
    parser.add_argument("--out", type=Path, default=Path("build/calibrate"), help="for the scores")
    parser.add_argument("--page", type=Path, default=PAGE, help="the results page")
    options = parser.parse_args()
    if options.seed not in CALIBRATE:
        parser.error(f"seed {options.seed} is not one of {CALIBRATE.start} to {CALIBRATE.stop - 1}")
    models = model_file.reference_rig()
    asked = [("clean" if k % 2 else SILENCED, k) for k in range(options.clean)]
    asked += [(kind, k) for k in range(options.cases) for kind in KINDS]
    done = []
    for number, (kind, k) in enumerate(asked, start=1):
        done.append(_searched(options.out, kind, options.seed + k, models))
        sys.stderr.write(f"{number} of {len(asked)}: {done[-1].name}\n")
    write_text_atomic(options.page, _page(done, options.seed))
    sys.stderr.write(f"{options.page} written\n")
    return 0


def log_score(cases: Sequence[Searched], numbers: Numbers) -> float:
    """Return the mean log probability of the truth."""
    return float(np.mean([score for case in cases for score in case.log_scores(numbers)]))


def best_numbers(cases: Sequence[Searched]) -> Numbers:
    """Return the best values of the grid, one number after another until none changes."""
    best, before = DEFAULT, None
    while best != before:
        before = best
        for name, values in GRID.items():
            best = max(
                (_with(best, name, value) for value in values),
                key=lambda numbers: log_score(cases, numbers),
            )
    return best


def _with(numbers: Numbers, name: str, value: float) -> Numbers:
    changed: dict[str, Any] = {name: value}
    return replace(numbers, **changed)


def _searched(out: Path, kind: str, seed: int, models: Sequence[Model]) -> Searched:
    path = out / commit(Path.cwd()) / f"{kind}-{seed}.json"
    if not path.exists():
        campaign, families = _drawn(kind, seed)
        recordings = list(campaign.evidence)
        whole = answer(recordings, models, split(recordings))
        found = whole.found
        ranked = found.conditional[0] if found.conditional else found.first
        content = {
            "first": [_row(p.family, p.best, p.gain) for p in _best(ranked)],
            "findings": [[_row(p.family, p.best, p.gain) for p in k.likely] for k in whole.kept],
            "families": families,
        }
        write_text_atomic(path, json.dumps(content))
    return Searched(path.stem, **json.loads(path.read_text()))


def _drawn(kind: str, seed: int) -> tuple[Campaign, Sequence[Sequence[str]]]:
    """Return a drawn campaign, and the true families of each effect."""
    if kind == SILENCED:
        return draw(seed, "confounded", gear_ratio=GEAR_RATIO).twin, ()
    case = draw(seed, kind, gear_ratio=GEAR_RATIO)
    return case.campaign, case.truth.families


def _best(ranked: Sequence[Scored]) -> list[Probability]:
    """Return the best candidate of each family, however improbable."""
    best: dict[str, Scored] = {}
    for one in ranked:
        best.setdefault(one.candidate.cause.family, one)
    return [Probability(family, 0.0, one, one.gain) for family, one in best.items()]


def _row(family: str, one: Scored, gain: float) -> Row:
    return family, gain, one.price.choices, one.price.rare, one.price.amplitudes


def _page(done: Sequence[Searched], seed: int) -> str:
    clean = [case for case in done if not case.families]
    named = [case for case in done if case.families]
    best = best_numbers(done)
    early = sum(any(p > 0.5 for p in _shares(c.first, DEFAULT).values()) for c in clean)
    false = sum(bool(case.findings) for case in clean)
    bound = float(beta.ppf(0.95, false + 1, len(clean) - false)) if clean else 1.0
    conformal = (false + 1) / (len(clean) + 1)  # exchangeable seeds, nothing chosen by these
    stated = [one for case in named for one in case.stated(DEFAULT)]
    rows = "\n".join(
        f"| {name} | {getattr(DEFAULT, name):g} | {getattr(best, name):g} | "
        + ", ".join(f"{v:g}: {log_score(done, _with(best, name, v)):.3f}" for v in values)
        + " |"
        for name, values in GRID.items()
    )
    return f"""# The numbers of a diagnosis

Written by `python -m benchmarks.diagnosis.calibrate` at commit {commit(Path.cwd())},
{date.today().isoformat()}, from seed {seed} of the calibration range: {len(named)} campaigns with a
cause ({", ".join(KINDS)}), {len(clean)} without one: half of them are rigs and protocols in which
an effect would be confounded.

Mean log probability of the truth: {log_score(done, DEFAULT):.3f} with the shipped numbers,
{log_score(done, best):.3f} with the best of the values that were compared, one number at a time.

| number | shipped | best | value: mean log probability |
| --- | --- | --- | --- |
{rows}

In the training runs {early} of {len(clean)} campaigns without a cause show one at more than one
half. After the test runs {false} have a finding. By split conformal prediction the next such
campaign has one with a probability of at most {100.0 * conformal:.2f} %; with a confidence of 95 %
fewer than {100.0 * bound:.1f} % of all such campaigns have one.

How often the family that a finding names is the true one, by the confidence stated:

{_reliability(stated)}
"""


def _reliability(stated: Sequence[tuple[float, bool]]) -> str:
    rows = ["| confidence | findings | mean stated | right |", "| --- | --- | --- | --- |"]
    for low in np.arange(10) / 10.0:
        inside = [one for one in stated if low <= min(one[0], 1.0 - 1e-9) < low + 0.1]
        if inside:
            mean, right = np.mean(inside, axis=0)
            rows.append(
                f"| {low:.1f} to {low + 0.1:.1f} | {len(inside)} | {mean:.3f} | {right:.3f} |"
            )
    if stated:
        mean, right = np.mean(stated, axis=0)
        rows.append(f"| all | {len(stated)} | {mean:.3f} | {right:.3f} |")
    return "\n".join(rows)


if __name__ == "__main__":
    raise SystemExit(main())
