"""Run every benchmark of this folder and print the ratios; exit 1 when a target is missed.

`python -m benchmarks [NAME ...] [--json] [--out FILE]`: all of them or those named; `--out` writes
the table as Markdown with the date, the commit and the machine's number of cores.
"""

import argparse
import importlib
import json
import os
import pkgutil
import sys
from dataclasses import asdict
from pathlib import Path

import benchmarks
from benchmarks.ratio import Ratio
from estimation.files import write_text_atomic
from rig.output.provenance import Provenance
from rig.output.table import TextTable, to_page

PREFIX = "bench_"


def main() -> int:
    """Run the benchmarks the command line asks for."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("names", nargs="*", help="benchmarks to run; all if none")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout")
    parser.add_argument("--out", type=Path, help="Markdown file for the table")
    options = parser.parse_args()
    ratios = [ratio for name in _names(options.names) for ratio in _measure(name)]
    if options.json:
        sys.stdout.write(json.dumps([asdict(r) | {"holds": r.holds} for r in ratios]) + "\n")
    if options.out:
        write_text_atomic(options.out, _markdown(ratios))
    return 0 if all(r.holds for r in ratios) else 1


def _names(wanted: list[str]) -> list[str]:
    found = [m.name for m in pkgutil.iter_modules(benchmarks.__path__)]
    names = [name.removeprefix(PREFIX) for name in found if name.startswith(PREFIX)]
    unknown = sorted(set(wanted) - set(names))
    if unknown:
        sys.exit(f"no benchmark {', '.join(unknown)}; there are {', '.join(names)}")
    return wanted or names


def _measure(name: str) -> list[Ratio]:
    ratios: list[Ratio] = importlib.import_module(f"benchmarks.{PREFIX}{name}").measure()
    for r in ratios:
        verdict = "ok  " if r.holds else "MISS"
        sys.stderr.write(f"{verdict} {r.ratio:8.1f} (target {_target(r)})  {r.name}\n")
        sys.stderr.write(f"                {r.detail}\n" if r.detail else "")
    return ratios


def _target(ratio: Ratio) -> str:
    return f"{'at least' if ratio.higher_is_better else 'at most'} {ratio.target:g}"


def _markdown(ratios: list[Ratio]) -> str:
    rows = [
        [r.name, f"{r.ratio:.1f}", _target(r), "yes" if r.holds else "**no**", r.detail]
        for r in ratios
    ]
    paragraphs = [
        "Benchmarks",
        "Each line is a ratio measured in one run against the baseline its name states, on"
        f" {os.cpu_count()} cores. The machine was shared: the figures behind a ratio vary, the"
        " ratio less so.",
    ]
    table = TextTable("Ratios", ("ratio", "measured", "target", "holds", "from"), rows)
    return to_page(paragraphs, [table], Provenance.now(0))


if __name__ == "__main__":
    sys.exit(main())
