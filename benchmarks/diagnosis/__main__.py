"""Measure how good a version of `rig diagnose` is, and append a line to the results page.

`python -m benchmarks.diagnosis measure [--varied] [--own] [--strangers] [--otherlab FOLDER]
[--machines FOLDER]`, without a generator `--varied`. Resumes where it stopped; a line goes to the
page when every case is answered.
"""

import argparse
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from benchmarks.diagnosis import machines, otherlab, own, strangers, varied
from benchmarks.diagnosis.asking import Rig
from benchmarks.diagnosis.case import KINDS, Case
from benchmarks.diagnosis.measure import Row, measure
from benchmarks.diagnosis.page import PAGE, Measured, append, next_to_judge
from benchmarks.rigs import part_of


@dataclass(frozen=True)
class Generator:
    """Cases, and what they are called on the page: a folder goes by its last name."""

    name: str
    cases: list[Case]
    seed: int | None = None

    @property
    def folder(self) -> str:
        """Name of the folder of its answers."""
        return self.name if self.seed is None else f"{self.name}-{self.seed}"


def main() -> int:
    """Measure what the command line asks for."""
    options = _parser().parse_args()
    options.varied |= not (options.own or options.strangers or options.otherlab or options.machines)
    rig = Rig(options.rig, options.version)
    for generator in _generators(options):
        rows = measure(
            [c for c in generator.cases if c.name.startswith(tuple(options.only.split(",")))],
            rig,
            options.out / rig.version / generator.folder,
            ask=not options.no_asking,
            on_row=_print_row,
        )
        if rows and not options.no_page:
            append(options.page, Measured(rig.version, generator.name, generator.seed), rows)
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.diagnosis", description=__doc__)
    parser.add_argument("command", choices=["measure"])
    parser.add_argument(
        "--varied", action="store_true", help="rigs, protocols and forms drawn at random"
    )
    parser.add_argument("--own", action="store_true", help="the reference rig and its protocols")
    parser.add_argument("--strangers", action="store_true", help="machines drawn at random")
    parser.add_argument("--otherlab", type=Path, help="folder of another simulator and its cases")
    parser.add_argument("--machines", type=Path, help="folder of measured data, one a machine")
    parser.add_argument(
        "--rig",
        type=Path,
        default=Path(sys.executable).parent / "rig",
        help="executable in .venv/bin of the checkout that is measured",
    )
    parser.add_argument("--version", default="", help="its name on the page; its commit if none")
    parser.add_argument("--seed", type=int, help="the next judging block if none")
    parser.add_argument(
        "--gear-ratio", type=float, help="of --varied: one for all rigs, for versions that need it"
    )
    parser.add_argument(
        "--counts", type=_counts, default=own.COUNTS, help="of simulated cases: class=N,class=N"
    )
    parser.add_argument("--only", default="", help="only cases whose names begin so, with commas")
    parser.add_argument("--out", type=Path, default=Path("build/measure"), help="for the answers")
    parser.add_argument("--page", type=Path, default=PAGE, help="the results page")
    parser.add_argument("--no-page", action="store_true", help="append no line")
    parser.add_argument("--no-asking", action="store_true", help="count the kept answers only")
    return parser


def _counts(text: str) -> dict[str, int]:
    counts = {}
    for word in text.split(","):
        kind, _, number = word.partition("=")
        if kind not in KINDS or not number.isdigit():
            raise argparse.ArgumentTypeError(f"{word!r} is not a count; one of {', '.join(KINDS)}")
        counts[kind] = int(number)
    return counts


def _generators(options: argparse.Namespace) -> Iterator[Generator]:
    if options.own or options.varied or options.strangers:
        seed = next_to_judge(options.page) if options.seed is None else options.seed
        _say(f"seed {seed}: {part_of(seed)}")
        if options.own:
            yield Generator("own", list(own.cases(seed, options.counts)), seed)
        if options.varied:
            ratio = options.gear_ratio
            name = "varied" if ratio is None else f"varied, gear {ratio:g}"
            drawn = varied.cases(seed, options.counts, options.out / "truths", ratio)
            yield Generator(name, list(drawn), seed)
        if options.strangers:
            drawn = strangers.cases(seed, options.counts, options.out / "truths")
            yield Generator("strangers", list(drawn), seed)
    for path, cases in ((options.otherlab, otherlab.cases), (options.machines, machines.cases)):
        if path is not None and not path.is_dir():
            _say(f"skipped: no folder {path}")
        elif path is not None:
            yield Generator(path.name, list(cases(path)))


def _print_row(row: Row) -> None:
    verdict = {True: "right", False: "WRONG", None: "-"}[row.right]
    stated = "; ".join(row.named) or row.note
    if row.solved is not None:
        stated += f"; after the proposed runs {'solved' if row.solved else 'not solved'}"
    _say(f"{row.case:24s} {verdict:6s} {row.cpu_s:6.1f} s  {stated}")


def _say(text: str) -> None:
    sys.stderr.write(text + "\n")
    sys.stderr.flush()


if __name__ == "__main__":
    sys.exit(main())
