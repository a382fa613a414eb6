"""How long `rig --help` takes against a bare interpreter."""

import subprocess
import sys

from benchmarks.ratio import Ratio, best_of


def measure() -> list[Ratio]:
    """Time both as whole processes."""

    def run(*words: str) -> None:
        subprocess.run([sys.executable, *words], check=True, capture_output=True)  # noqa: S603

    bare_s = best_of(lambda: run("-c", "pass"), 15)
    help_s = best_of(lambda: run("-m", "rig", "--help"), 15)
    return [
        Ratio(
            "`rig --help` over a bare interpreter's start",
            help_s / bare_s,
            10.0,
            higher_is_better=False,
            detail=f"{help_s * 1e3:.0f} ms over {bare_s * 1e3:.0f} ms",
        )
    ]
