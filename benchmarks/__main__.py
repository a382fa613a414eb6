"""Run every benchmark of this folder and print the ratios; exit 1 when a target is missed."""

import importlib
import json
import pkgutil
import sys
from dataclasses import asdict

import benchmarks
from benchmarks.ratio import Ratio


def main() -> int:
    """Run all `bench_*` modules, or those named on the command line."""
    wanted = [word for word in sys.argv[1:] if not word.startswith("-")]
    ratios: list[Ratio] = []
    for module in pkgutil.iter_modules(benchmarks.__path__):
        if not module.name.startswith("bench_"):
            continue
        if wanted and module.name.removeprefix("bench_") not in wanted:
            continue
        sys.stderr.write(f"{module.name} ...\n")
        ratios += importlib.import_module(f"benchmarks.{module.name}").measure()
    if "--json" in sys.argv:
        sys.stdout.write(json.dumps([asdict(r) | {"holds": r.holds} for r in ratios]) + "\n")
    for r in ratios:
        sign = ">=" if r.higher_is_better else "<="
        verdict = "ok  " if r.holds else "MISS"
        sys.stderr.write(f"{verdict} {r.ratio:8.1f} (target {sign} {r.target:g})  {r.name}\n")
        sys.stderr.write(f"                {r.detail}\n" if r.detail else "")
    return 0 if all(r.holds for r in ratios) else 1


if __name__ == "__main__":
    sys.exit(main())
