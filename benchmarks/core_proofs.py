"""Decide the theorems on the firmware's core, and write the page of what is shown.

    python -m benchmarks.core_proofs --python .venv-proofs/bin/python [THEOREM ...]

Each theorem of `firmware/proofs/symbolic.cpp` is compiled and its machine code is run on symbols in
place of numbers (`firmware/proofs/symbolic.py`, angr), so that a claim is decided for all of them.
`make proofs` makes the interpreter with angr and decides every theorem.

Exit code 1 when a claim can be broken.
"""

import argparse
import json
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from benchmarks.hunt import FIRMWARE
from estimation.files import write_text_atomic
from rig.bench.firmware import source_hash
from rig.output.provenance import Provenance
from rig.output.table import TextTable, to_page

SOURCE = Path("proofs") / "symbolic.cpp"
PAGE = Path("docs/results/core-proofs.md")
LONGEST_S = 1800.0
_THEOREM = re.compile(r'THEOREM\((\w+),\s*((?:"[^"]*"\s*)+)\)')


@dataclass(frozen=True)
class Decided:
    """What came of one theorem.

    Attributes:
        paths: Ways through the code that were followed to their end.
        broken: Claims that some case breaks, and undefined behaviour that some case reaches.
    """

    name: str
    text: str
    paths: int
    seconds: float
    broken: tuple[str, ...]


def theorems() -> dict[str, str]:
    """Return the name of every theorem, and what it states."""
    found = _THEOREM.findall((FIRMWARE / SOURCE).read_text())
    return {name: "".join(re.findall(r'"([^"]*)"', text)) for name, text in found}


def build(firmware: Path = FIRMWARE) -> Path | None:
    """Compile the theorems with a firmware's core; None where they do not compile."""
    words = ["make", "-s", "-C", str(firmware), "build/symbolic"]
    done = subprocess.run(words, capture_output=True, check=False)  # noqa: S603
    return firmware / "build" / "symbolic" if done.returncode == 0 else None


def decide(program: Path, name: str, python: str, longest_s: float = LONGEST_S) -> Decided:
    """Decide one theorem by an interpreter that has angr; not shown in time is broken.

    Raises:
        RuntimeError: The interpreter has no angr, or the theorem could not be decided.
    """
    words = [python, str(FIRMWARE / "proofs" / "symbolic.py"), str(program), name]
    text = theorems()[name]
    try:
        done = subprocess.run(  # noqa: S603
            words, capture_output=True, text=True, check=False, timeout=longest_s
        )
    except subprocess.TimeoutExpired:
        return Decided(name, text, 0, longest_s, ("not decided in time",))
    if done.returncode != 0:
        raise RuntimeError(f"{name} was not decided: {done.stderr.strip()[-800:]}")
    said = json.loads(done.stdout.splitlines()[-1])
    return Decided(name, text, said["paths"], said["seconds"], tuple(said["broken"]))


def page(decided: list[Decided]) -> str:
    """Return the page of what is shown."""
    paragraphs = [
        "Theorems on the core",
        "Written by `make proofs`. Each theorem is decided for every value that it names, by"
        " symbolic execution of the machine code that g++ makes of the core with `-O1`, in which"
        " undefined behaviour and an index out of range end a path and count as broken. What is"
        " assumed, and what is not shown, is in [safety of the core](../safety-core.md)."
        f" Core {source_hash() or 0:08x}; nothing is drawn, so the seed has no meaning.",
    ]
    rows = []
    for one in decided:
        shown = "yes" if not one.broken else "**no**: " + "; ".join(one.broken)
        rows.append([one.name, one.text, str(one.paths), f"{one.seconds:.0f}", shown])
    table = TextTable("Theorems", ("theorem", "states", "paths", "s", "shown"), rows)
    return to_page(paragraphs, [table], Provenance.now(0))


def main() -> int:
    """Decide the theorems."""
    known = theorems()
    parser = argparse.ArgumentParser(prog="python -m benchmarks.core_proofs", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="THEOREM", help="of these only; then no page")
    parser.add_argument("--python", default=sys.executable, help="an interpreter that has angr")
    options = parser.parse_args()
    if unknown := [n for n in options.names if n not in known]:
        parser.error(f"no theorem {unknown[0]}; there are {', '.join(known)}")
    program = build()
    if program is None:
        sys.stderr.write("the theorems do not compile: make -C firmware build/symbolic\n")
        return 1
    decided = []
    for name in options.names or known:
        decided.append(decide(program, name, options.python))
        one = decided[-1]
        said = "shown" if not one.broken else f"BROKEN: {'; '.join(one.broken)}"
        sys.stderr.write(f"{name}: {said}, {one.paths} paths, {one.seconds:.0f} s\n")
    if not options.names:
        write_text_atomic(PAGE, page(decided))
    return int(any(one.broken for one in decided))


if __name__ == "__main__":
    sys.exit(main())
