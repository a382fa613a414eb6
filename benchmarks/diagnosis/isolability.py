"""How well `rig diagnose --plan` foresees which effects a diagnosis confuses.

`python -m benchmarks.diagnosis.isolability FOLDER ANSWERS`: FOLDER is another simulator with its
cases, ANSWERS the answers that `python -m benchmarks.diagnosis measure --otherlab FOLDER` kept. The
effects that the runs of a clean case can distinguish are held against the sets that were reported
on its other cases: the area under the curve of "reported in the set" over "expected".
"""

import argparse
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from scipy import stats

from benchmarks.diagnosis import otherlab
from benchmarks.diagnosis.asking import Answer
from estimation import model_file
from estimation.causes.isolability import Isolable, isolability
from estimation.files import write_text_atomic
from rig.importers.registry import open_campaign
from rig.output.provenance import Provenance
from rig.output.table import TextTable, to_page

CLEAN = "n-clean-0"
"""Case without an effect: its runs have the protocol of the others."""

PAGE = Path("docs/results/isolability.md")


def main() -> int:
    """Hold the expected confusions against the reported ones."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.diagnosis.isolability", description=__doc__
    )
    parser.add_argument("folder", type=Path, help="folder of another simulator and its cases")
    parser.add_argument("answers", type=Path, help="folder of the kept answers on its cases")
    parser.add_argument("--page", type=Path, default=PAGE, help="the results page")
    options = parser.parse_args()
    cases = {case.name: case for case in otherlab.cases(options.folder)}
    with tempfile.TemporaryDirectory() as folder:
        cases[CLEAN].write(Path(folder))
        runs = list(open_campaign(Path(folder)).evidence)
        expected = isolability(model_file.reference_rig(), runs, on_part=_say)
    rows, pairs = [], list[tuple[float, bool]]()
    for name, equation, families, reported in _single(options.folder, options.answers):
        own = [e for e in expected if e.equation == equation and e.family in families]
        if not own:
            continue
        chance = _chances(own, {e.family for e in expected} - set(families))
        pairs += [(p, family in reported) for family, p in chance.items()]
        likely = [f for f, p in sorted(chance.items(), key=lambda q: -q[1])[:3] if p > 0.0]
        rows.append((name, ", ".join(sorted(reported)) or "-", ", ".join(likely) or "-"))
    if not rows:
        parser.error(f"{options.answers} has no answer on a case with one effect")
    area = area_under_curve([p for p, _ in pairs], [there for _, there in pairs])
    paragraphs = [
        "Expected and reported confusions of effects",
        f"Written by `python -m benchmarks.diagnosis.isolability FOLDER ANSWERS`. {len(rows)} cases"
        f" with one effect, {len(pairs)} pairs of a true effect and another family: the area under"
        f" the curve of reported over expected confusion is {area:.3f}.",
    ]
    table = TextTable("", ("case", "reported besides the effect", "expected first"), tuple(rows))
    write_text_atomic(options.page, to_page(paragraphs, [table], Provenance.now(0)))
    sys.stderr.write(f"area {area:.3f} over {len(pairs)} pairs; {options.page} written\n")
    return 0


def area_under_curve(scores: Sequence[float], labels: Sequence[bool]) -> float:
    """Return the probability that a pair with the label has the larger score, ties half."""
    there, values = np.array(labels), np.array(scores)
    larger = stats.mannwhitneyu(values[there], values[~there]).statistic
    return float(larger / (there.sum() * (~there).sum()))


def _single(folder: Path, answers: Path) -> Iterator[tuple[str, str, list[str], set[str]]]:
    """Yield name, equation, true families and other families reported of each single effect."""
    listed = otherlab.listed(folder)
    for one in listed:
        kept = answers / f"{one['name']}.json"
        if one["kind"] != "single" or not kept.exists():
            continue
        report = Answer.load(kept).report
        found = [] if report is None else report["findings"][:1]
        reported = {n for f in found for n in (f["family"], *f["alternatives"])}
        yield one["name"], one["balance"], one["accept"], reported - set(one["accept"])


def _chances(own: Sequence[Isolable], others: set[str]) -> Mapping[str, float]:
    """Return each other family's expected probability next to a true effect."""
    return {f: max(e.others.get(f, 0.0) for e in own) for f in sorted(others)}


def _say(done: int, count: int) -> None:
    sys.stderr.write(f"\r{done} of {count} effects")
    sys.stderr.flush()


if __name__ == "__main__":
    sys.exit(main())
