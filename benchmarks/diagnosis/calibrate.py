"""Calibrate the numbers of a diagnosis on campaigns drawn at random, and write the results page.

`python -m benchmarks.diagnosis.calibrate` searches the training runs of drawn campaigns whose seeds
are kept for calibration. Named causes give `sharpness`: the one with the best mean log probability
of the true family. Clean campaigns give `cause_cost`: the least one with a share of false
findings below the bound, by split conformal prediction. Resumes where it stopped.
"""

import argparse
import json
import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from pathlib import Path

import numpy as np

from benchmarks.diagnosis.asking import commit
from benchmarks.rigs import CALIBRATE, draw
from estimation import model_file
from estimation.campaign import Campaign
from estimation.causes.equations import lay_out, on_one_clock
from estimation.causes.instruments import add_instruments
from estimation.causes.numbers import DEFAULT
from estimation.causes.search import search
from estimation.diagnosis.split import split
from estimation.files import write_text_atomic
from estimation.model import Model

REFERENCE_RIG = ("motor", "gearbox", "cable", "stretch")
GEAR_RATIO = 35.0
"""Of all rigs: the derived channels of the reference rig are made for it."""

KINDS = ("strong", "weak", "outside")
"""Classes of cases with one cause in all runs."""

SHARPNESS = (4.0, 6.0, 8.0, 10.0, 12.0, 16.0, 20.0, 25.0, 32.0)
FALSE_FINDINGS = 0.01
PAGE = Path("docs/results/diagnosis-numbers.md")


@dataclass(frozen=True)
class Searched:
    """What a search came to.

    Attributes:
        name: The case.
        best: Score of the best cause.
        scores: Family to the score of its best cause, those above zero.
        families: True families; none in a clean campaign.
    """

    name: str
    best: float
    scores: Mapping[str, float]
    families: Sequence[str]


def main() -> int:
    """Calibrate."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.diagnosis.calibrate", description=__doc__
    )
    parser.add_argument("--cases", type=int, default=30, help="of each class with a cause")
    parser.add_argument("--clean", type=int, default=100, help="clean campaigns")
    parser.add_argument("--seed", type=int, default=CALIBRATE.start, help="first seed")
    parser.add_argument("--out", type=Path, default=Path("build/calibrate"), help="for the scores")
    parser.add_argument("--page", type=Path, default=PAGE, help="the results page")
    options = parser.parse_args()
    if options.seed not in CALIBRATE:
        parser.error(f"seed {options.seed} is not one of {CALIBRATE.start} to {CALIBRATE.stop - 1}")
    models = [model_file.read(Path(name)) for name in REFERENCE_RIG]
    asked = [("clean", k) for k in range(options.clean)]
    asked += [(kind, k) for k in range(options.cases) for kind in KINDS]
    done = []
    for kind, k in asked:
        done.append(_searched(options.out, kind, options.seed + k, models))
        sys.stderr.write(f"{len(done)} of {len(asked)}: {done[-1].name}\n")
    write_text_atomic(options.page, _page(done, options.seed))
    sys.stderr.write(f"{options.page} written\n")
    return 0


def log_score(cases: Sequence[Searched], sharpness: float) -> float:
    """Return the mean log probability of the true family; of a cause not found, none counts."""
    found = []
    for case in cases:
        if case.scores:
            top = max(case.scores.values())
            weights = {f: math.exp(sharpness * (s - top)) for f, s in case.scores.items()}
            right = sum(w for f, w in weights.items() if f in case.families)
            found.append(math.log(max(right / sum(weights.values()), 1e-3)))
    return float(np.mean(found))


def least_cost(clean: Sequence[Searched], share: float) -> float | None:
    """Return the cost of a cause for a share of false findings; None with too few cases."""
    rank = math.ceil((len(clean) + 1) * (1.0 - share))
    if rank > len(clean):
        return None
    return DEFAULT.cause_cost + sorted(case.best for case in clean)[rank - 1]


def _searched(out: Path, kind: str, seed: int, models: Sequence[Model]) -> Searched:
    path = out / commit(Path.cwd()) / f"{kind}-{seed}.json"
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        case = draw(seed, kind, gear_ratio=GEAR_RATIO)
        recordings = on_one_clock(list(Campaign.of(case.recordings).evidence))
        train = split(recordings).discover
        layout = lay_out(models, recordings, train)
        add_instruments(layout, train)
        found = search(layout.select(train))
        scores: dict[str, float] = {}
        for one in found.conditional[0] if found.conditional else ():
            if one.score > 0.0:
                scores.setdefault(one.candidate.cause.family, one.score)
        families = [family for group in case.truth.families for family in group]
        content = {"best": found.clean_score, "scores": scores, "families": families}
        write_text_atomic(path, json.dumps(content))
    content = json.loads(path.read_text())
    return Searched(path.stem, content["best"], content["scores"], content["families"])


def _page(done: Sequence[Searched], seed: int) -> str:
    clean = [case for case in done if not case.families]
    named = [case for case in done if case.families]
    found = [case for case in named if case.scores]
    rows = "\n".join(f"| {s:g} | {log_score(named, s):.3f} |" for s in SHARPNESS)
    best = max(SHARPNESS, key=lambda s: log_score(named, s))
    bound = least_cost(clean, FALSE_FINDINGS)
    false = sum(case.best > 0.0 for case in clean)
    conformal = (
        f"{bound:.3f}" if bound is not None else f"not decided by {len(clean)} clean campaigns"
    )
    return f"""# The numbers of a diagnosis

Written by `python -m benchmarks.diagnosis.calibrate` at commit {commit(Path.cwd())},
{date.today().isoformat()}, from seed {seed} of the calibration range: {len(named)} campaigns with a
cause ({", ".join(KINDS)}), {len(clean)} clean ones.

## sharpness

Mean log probability of the true family, over the {len(found)} campaigns in which a cause was found.
Best: {best:g}. Shipped: {DEFAULT.sharpness:g}.

| sharpness | mean log probability |
| --- | --- |
{rows}

## cause_cost

False findings with the shipped cost, before the test runs are opened: {false} of {len(clean)}. The
least cost for at most {FALSE_FINDINGS:.0%} false findings, by split conformal prediction:
{conformal}. Shipped: {DEFAULT.cause_cost:g}.
"""


if __name__ == "__main__":
    raise SystemExit(main())
