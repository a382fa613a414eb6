"""The pages of docs/results: the command that makes each, and which are older than their code.

`python -m benchmarks.results` lists them: commit, day, and the commits to the page's code since.
`--remake NAME,...` runs the commands of these pages one after the other (`old`: of all that are
older than their code, the quickest first). A page that is not older is skipped, so an interrupted
call resumes. RIG_DATA names the folder of the measured data, RIG_OTHERLAB that of the other
simulator, RIG_ANSWERS that of the answers kept on its cases.
"""

import argparse
import os
import re
import shlex
import shutil
import subprocess
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "docs/results"
FOLDERS = {"data": "RIG_DATA", "otherlab": "RIG_OTHERLAB", "answers": "RIG_ANSWERS"}
"""Word of a command to the variable with its folder."""

CHANGES = "+changes"
COMMIT = re.compile(rf"(?:commit |^\| )([0-9a-f]{{7,40}}(?:\{CHANGES})?)\b", re.MULTILINE)
"""A page's commit in a sentence, or at the start of a table's row; the last is the newest."""


@dataclass(frozen=True)
class Page:
    """One page.

    Attributes:
        name: Name of its file, without the ending.
        command: Command that makes it, from the project's folder; `{data}` and so on are those of
            `FOLDERS`, `{state}` a folder where the command keeps finished parts.
        code: Paths of the code it speaks of.
        minutes: Processor time, roughly.
    """

    name: str
    command: str
    code: str
    minutes: int

    def made(self) -> tuple[str, str]:
        """Return the day and the commit the page was made on; `never`, `-` without a page."""
        path = FOLDER / f"{self.name}.md"
        text = path.read_text(encoding="utf-8") if path.exists() else ""
        commits = COMMIT.findall(text)
        days = re.findall(r"\b20\d\d-\d\d-\d\d", text)
        return (days[-1], commits[-1]) if commits and days else ("never", "-")

    def commits_since(self) -> int | None:
        """Return the number of commits to its code since; None if its commit is not known."""
        commit = self.made()[1].removesuffix(CHANGES)
        git = shutil.which("git") or "git"
        words = [git, "rev-list", "--count", f"{commit}..HEAD", "--", *self.code.split()]
        found = subprocess.run(  # noqa: S603 - git itself, with words of the table
            words, cwd=ROOT, capture_output=True, text=True, check=False
        )
        return int(found.stdout) if found.returncode == 0 else None

    def words(self, folders: Mapping[str, str]) -> list[str]:
        """Return the words of its command, with this interpreter and its programs.

        Raises:
            KeyError: The command needs a folder that is not stated.
        """
        known = {**folders, "state": str(ROOT / f"build/results/{self.name}")}
        program, *rest = shlex.split(self.command.format_map(known))
        python = Path(sys.executable)
        return [str(python if program == "python" else python.with_name(program)), *rest]


_ESTIMATORS = "rig/importers rig/models estimation/bank estimation/estimators estimation/networks"
_ARM = "rig/arm estimation/arm estimation/within_bounds.py"
_DIAGNOSIS = "estimation/causes estimation/effects rig/diagnosis"
_TOOL = "--data {data}/mrdlab-Tool"
_LOOP = (
    "rig/studies/loop rig/importers estimation/effects estimation/fitting.py estimation/model.py"
    " estimation/diagnosis/split.py"
)
_CORE = "firmware/core firmware/proofs"

_SEEDS = "--state {state} --figures docs/figures --seeds"


def _study(words: str, code: str, minutes: int, page: str = "") -> Page:
    """Return the page of a study: its name, unless given, is the first of the command's words."""
    name = page or words.split()[0]
    return Page(name, f"rig study {words} --out docs/results/{name}.md", code, minutes)


PAGES = (
    _study("instruments --data {data}", f"rig/studies/instruments {_ESTIMATORS}", 10, "adapt"),
    Page(
        "archive",
        "python -m benchmarks.archive --out docs/results/archive.md",
        "benchmarks/archive.py rig/campaigns rig/reports/diagnosed.py",
        30,
    ),
    Page(
        "bench",
        "python -m benchmarks --out docs/results/bench.md",
        "benchmarks/bench_*.py drivers/framing.py drivers/framing_compiled.py rig/log rig/importers"
        " rig/simulation rig/cli/main.py estimation/estimators",
        5,
    ),
    Page(
        "changes",
        "python -m benchmarks.changes --first 500 --pairs 36 --out docs/results/changes.md",
        "benchmarks/changes.py estimation/changes estimation/causes benchmarks/rigs",
        5,
    ),
    Page(
        "changes-measured",
        "python -m benchmarks.measured_changes --data {data}"
        " --out docs/results/changes-measured.md",
        "benchmarks/measured_changes.py estimation/changes estimation/causes",
        6,
    ),
    Page("core-mutants", "python -m benchmarks.core_mutants", _CORE, 60),
    Page(
        "core-proofs",
        "python -m benchmarks.core_proofs --python .venv-proofs/bin/python",
        f"firmware/proofs {_CORE}",
        6,
    ),
    _study(f"delsol {_SEEDS} 1", f"rig/studies/delsol {_ARM} {_DIAGNOSIS}", 30),
    Page(
        "diagnosis-numbers",
        "python -m benchmarks.diagnosis.calibrate",
        f"benchmarks/diagnosis {_DIAGNOSIS} benchmarks/rigs",
        60,
    ),
    Page("diagnosis-versions", "python -m benchmarks.diagnosis measure", _DIAGNOSIS, 60),
    _study(
        "excitation",
        "rig/arm/excitation.py estimation/arm/excitation.py estimation/arm/regressor.py",
        1,
    ),
    Page("hunt", "python -m benchmarks.hunt", _CORE, 60),
    Page(
        "isolability",
        "python -m benchmarks.diagnosis.isolability {otherlab} {answers}",
        f"benchmarks/diagnosis/isolability.py {_DIAGNOSIS}",
        2,
    ),
    _study(
        "intervals --data {data}",
        "rig/studies/instruments rig/importers estimation/bank estimation/estimators",
        10,
    ),
    _study(f"loop {_TOOL}_4_Maryland_L_4.tar.xz", _LOOP, 15),
    _study(f"loop {_TOOL}_5_Maryland_L_2.tar.xz", _LOOP, 15, "loop-tool5"),
    _study("machines {data}/machines", f"rig/studies/machines {_DIAGNOSIS}", 10),
    _study(
        "oneill --data {data} --states --kinds --networks --every 24 --state {state}"
        " --figures docs/figures",
        f"rig/studies/oneill {_ESTIMATORS}",
        60,
    ),
    _study("payload --data {data}/psm --on one19_insertion_105g --on one19 --on one18", _ARM, 1),
    _study(
        "pique --data {data}/psm --also one19 --figures docs/figures",
        f"rig/studies/pique {_ARM}",
        1,
    ),
    Page("reliability", "python -m benchmarks.reliability", "drivers firmware rig/recording", 90),
    _study(f"wrench {_SEEDS} 2", f"rig/studies/wrench {_ARM}", 30),
    _study(f"zhang {_SEEDS} 1", f"rig/studies/zhang {_ARM}", 30),
    _study(f"zhao {_SEEDS} 2", f"rig/studies/zhao rig/grasper {_DIAGNOSIS}", 6),
)


def main() -> int:
    """List the pages, or make those asked for again; exit 1 when one was not made."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.results", description=__doc__)
    parser.add_argument("--remake", default="", metavar="NAME,...", help="pages, or `old`")
    asked = [name for name in parser.parse_args().remake.split(",") if name]
    unknown = set(asked) - {page.name for page in PAGES} - {"old"}
    if unknown:
        parser.error(f"unknown page {', '.join(sorted(unknown))}")
    since = {page: page.commits_since() for page in PAGES}
    if not asked:
        sys.stdout.write(f"{'page':20}{'made':12}{'commit':17}{'commits since':>15}{'min':>5}\n")
        for page, count in since.items():
            known = "unknown" if count is None else count
            made, commit = page.made()
            sys.stdout.write(f"{page.name:20}{made:12}{commit:17}{known:>15}{page.minutes:>5}\n")
        return 0
    chosen = [p for p in PAGES if p.name in asked or "old" in asked]
    return max((_remake(p, since[p]) for p in sorted(chosen, key=lambda p: p.minutes)), default=0)


def _remake(page: Page, since: int | None) -> int:
    if since == 0 and not page.made()[1].endswith(CHANGES):
        return _note(page, "not older than its code")
    begun = time.monotonic()
    try:
        words = page.words({k: os.environ[v] for k, v in FOLDERS.items() if v in os.environ})
    except KeyError as error:
        _note(page, f"left out: set {FOLDERS[error.args[0]]} to the folder that it needs")
        return 1
    _note(page, shlex.join(words))
    code = subprocess.run(words, cwd=ROOT, check=False).returncode  # noqa: S603 - of the table
    _note(page, f"exit code {code} after {(time.monotonic() - begun) / 60:.1f} min")
    return int(code != 0)


def _note(page: Page, what: str) -> int:
    sys.stderr.write(f"{page.name}: {what}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
