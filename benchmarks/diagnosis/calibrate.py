"""Calibrate the numbers of a diagnosis on campaigns drawn at random, and write the results page.

`python -m benchmarks.diagnosis.calibrate` diagnoses drawn campaigns whose seeds are kept for
calibration, with a cause and without. `sharpness` and `cause_cost` are judged by the mean log
probability of the truth in the training runs: of the true family, or of no cause. The page also
states how often a clean campaign has a finding in the end, and how often stated confidences are
right. Resumes where it stopped.
"""

import argparse
import itertools
import json
import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date
from pathlib import Path

import numpy as np
from scipy.stats import beta

from benchmarks.rigs import CALIBRATE, draw
from estimation import model_file
from estimation.campaign import Campaign
from estimation.causes.numbers import DEFAULT
from estimation.causes.scoring import probabilities
from estimation.causes.verdict import answer
from estimation.diagnosis.split import split
from estimation.files import write_text_atomic
from estimation.model import Model
from rig.output.provenance import commit

REFERENCE_RIG = ("motor", "gearbox", "cable", "stretch")
GEAR_RATIO = 35.0
"""Of all rigs: the derived channels of the reference rig are made for it."""

KINDS = ("strong", "weak", "outside")
"""Classes of cases with one cause in all runs."""

SHARPNESS = (6.0, 8.0, 10.0, 12.0, 16.0, 20.0, 25.0, 32.0)
COSTS = (0.04, 0.06, 0.08, 0.1, 0.13, 0.16, 0.2)
LEAST = 1e-3
"""Probability that a truth which was not considered is given."""

LEVELS = (0.0, 0.5, 0.8, 0.95, 1.01)
"""Bounds of the classes of stated confidence."""

PAGE = Path("docs/results/diagnosis-numbers.md")


@dataclass(frozen=True)
class Searched:
    """What a search came to.

    Attributes:
        name: The case.
        candidates: Family, score and gain of the best of each in the first place.
        families: True families; none in a clean campaign.
        findings: Family and confidence of each finding in the end, 0 of an unknown form.
    """

    name: str
    candidates: Sequence[tuple[str, float, float]]
    families: Sequence[str]
    findings: Sequence[tuple[str, float]]

    def probability(self, sharpness: float, cost: float) -> float:
        """Return the probability of the truth at other numbers than the shipped ones."""
        names = [name for name, _, _ in self.candidates]
        scores, gains = np.array([(s, g) for _, s, g in self.candidates] or [(-1.0, 0.0)]).T
        shares = probabilities(scores + DEFAULT.cause_cost - cost, gains, sharpness)
        if not self.families:
            return float(1.0 - shares.sum())
        return float(sum(p for n, p in zip(names, shares, strict=False) if n in self.families))


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


def log_score(cases: Sequence[Searched], sharpness: float, cost: float) -> float:
    """Return the mean log probability of the truth."""
    return float(np.mean([math.log(max(c.probability(sharpness, cost), LEAST)) for c in cases]))


def _searched(out: Path, kind: str, seed: int, models: Sequence[Model]) -> Searched:
    path = out / commit(Path.cwd()) / f"{kind}-{seed}.json"
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        case = draw(seed, kind, gear_ratio=GEAR_RATIO)
        recordings = list(Campaign.of(case.recordings).evidence)
        whole = answer(recordings, models, split(recordings))
        found = whole.found
        ranked = found.conditional[0] if found.conditional else found.first
        best = {c.candidate.cause.family: c for c in reversed(ranked)}
        families = [family for group in case.truth.families for family in group]
        content = {
            "candidates": [(name, c.score, c.gain) for name, c in best.items()],
            "families": families,
            "findings": [(f.family, f.confidence or 0.0) for f in whole.diagnosis.findings],
        }
        write_text_atomic(path, json.dumps(content))
    content = json.loads(path.read_text())
    return Searched(path.stem, **content)


def _page(done: Sequence[Searched], seed: int) -> str:
    clean = [case for case in done if not case.families]
    named = [case for case in done if case.families]
    pairs = [(s, c) for s in SHARPNESS for c in COSTS]
    best = max(pairs, key=lambda pair: log_score(done, *pair))
    head = "| sharpness | " + " | ".join(f"cause_cost {c:g}" for c in COSTS) + " |"
    rows = "\n".join(
        f"| {s:g} | " + " | ".join(f"{log_score(done, s, c):.3f}" for c in COSTS) + " |"
        for s in SHARPNESS
    )
    early = sum(any(score > 0.0 for _, score, _ in case.candidates) for case in clean)
    false = sum(bool(case.findings) for case in clean)
    bound = float(beta.ppf(0.95, false + 1, len(clean) - false)) if clean else 1.0
    stated = [(c, f in case.families) for case in named for f, c in case.findings if c]
    return f"""# The numbers of a diagnosis

Written by `python -m benchmarks.diagnosis.calibrate` at commit {commit(Path.cwd())},
{date.today().isoformat()}, from seed {seed} of the calibration range: {len(named)} campaigns with a
cause ({", ".join(KINDS)}), {len(clean)} clean ones.

Mean log probability of the truth: of the true family, or of no cause. Best: sharpness {best[0]:g},
cause_cost {best[1]:g}. Shipped: {DEFAULT.sharpness:g}, {DEFAULT.cause_cost:g}.

{head}
|{" --- |" * (1 + len(COSTS))}
{rows}

With the shipped numbers the training runs of {early} of {len(clean)} clean campaigns show a cause.
After the test runs {false} have a finding: below {100.0 * bound:.1f} % of such campaigns, at 95 %.

How often the family that a finding names is the true one:

{_reliability(stated)}
"""


def _reliability(stated: Sequence[tuple[float, bool]]) -> str:
    rows = ["| confidence | findings | mean stated | right |", "| --- | --- | --- | --- |"]
    for low, high in itertools.pairwise(LEVELS):
        inside = [one for one in stated if low <= one[0] < high]
        if inside:
            mean, right = np.mean(inside, axis=0)
            span = f"{low:g} to {min(high, 1.0):g}"
            rows.append(f"| {span} | {len(inside)} | {mean:.3f} | {right:.3f} |")
    if stated:
        mean, right = np.mean(stated, axis=0)
        rows.append(f"| all | {len(stated)} | {mean:.3f} | {right:.3f} |")
    return "\n".join(rows)


if __name__ == "__main__":
    raise SystemExit(main())
