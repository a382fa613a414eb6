"""Search for what no rule of the core's safety should allow, from seed to seed, and go on tomorrow.

    python -m benchmarks.hunt [--hours H] [--commands N] [--again]

Two kinds of sequences run against the compiled core (`firmware/proofs/hunt.cpp`). In `commands`
hosts send anything at any time; in `faults` an honest host moves a small rig whose sensors, link,
host, board and load motor fail, up to eight faults a sequence. Whatever breaks a rule is printed
with its seed and its events, shrunk to as few as still break it. Where a search stopped is kept in
`build/hunt.json` for the core that it searched; another core begins from the start.

Exit code 1 when a rule was broken.
"""

import argparse
import json
import re
import subprocess
import sys
import tempfile
from dataclasses import asdict, dataclass, field
from pathlib import Path

from pydantic import TypeAdapter

from drivers.teensy.core import settings_bytes
from estimation.files import write_text_atomic
from rig.bench.firmware import source_hash
from rig.configuration.config import load_config
from rig.machines.choose import machine_of
from rig.output.provenance import Provenance
from rig.output.table import TextTable, to_page

FIRMWARE = Path(__file__).parents[1] / "firmware"
PROGRAM = FIRMWARE / "build" / "hunt"
STATE = Path("build/hunt.json")
PAGE = Path("docs/results/hunt.md")
CHUNKS = {"commands": 20_000, "faults": 5_000}
MOST_EVENTS = 5
"""Events of a sequence that is worth a person's time."""

_FOUND = re.compile(r"seed (\d+): ([^:]+):((?: \[[^]]+\])+)")


@dataclass(frozen=True)
class Search:
    """What one kind of search has come to.

    Attributes:
        sequences: Sequences run.
        hours: Hours of the rig's time.
        armings: How often a board was armed.
        trips: How often one tripped.
        farthest_rad: Farthest the shaft went, rad.
        found: Seed, rule and events of each sequence that broke a rule.
    """

    sequences: int = 0
    hours: float = 0.0
    armings: int = 0
    trips: int = 0
    farthest_rad: float = 0.0
    found: list[tuple[int, str, list[str]]] = field(default_factory=list)


def write_settings(path: Path) -> None:
    """Write gains and limits of the reference rig as the program takes them."""
    settings = load_config(Path("reference"))
    machine = machine_of(settings)
    limits = machine.board_limits(settings, settings.calibration_set())
    path.write_bytes(settings_bytes(machine.profile, machine.gains(settings), limits))


def run(program: Path, settings: Path, kind: str, first: int, count: int) -> Search:
    """Run seeds, and return what they came to.

    Raises:
        RuntimeError: The program failed.
    """
    words = [str(program), str(settings), kind, str(first), str(count)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)  # noqa: S603
    lines = done.stdout.splitlines()
    if done.returncode not in (0, 1) or not lines:
        raise RuntimeError(f"{' '.join(words)} ended with {done.returncode}: {done.stderr[-2000:]}")
    sums = json.loads(lines[-1])
    found = []
    for line in lines[:-1]:
        match = _FOUND.fullmatch(line)
        if match is None:
            raise RuntimeError(f"not understood: {line}")
        found.append((int(match[1]), match[2], re.findall(r"\[([^]]+)\]", match[3])))
    hours = sums["ticks"] / 3.6e6
    counts = (sums["sequences"], hours, sums["armings"], sums["trips"], sums["farthest_rad"])
    return Search(*counts, found)


def joined(one: Search, other: Search) -> Search:
    """Return two searches as one."""
    added = ("sequences", "hours", "armings", "trips", "found")
    sums = {name: getattr(one, name) + getattr(other, name) for name in added}
    return Search(**sums, farthest_rad=max(one.farthest_rad, other.farthest_rad))


def kept(core: str) -> dict[str, Search]:
    """Return the searches of a core so far."""
    state = json.loads(STATE.read_text()) if STATE.is_file() else {}
    if state.pop("core", "") != core:
        return {kind: Search() for kind in CHUNKS}
    return TypeAdapter(dict[str, Search]).validate_python(state)


def page(searches: dict[str, Search], core: str) -> str:
    """Return the page of what was searched and found."""
    paragraphs = [
        "The search for broken rules",
        "Written by `make hunt`, which goes on where it stopped. Random sequences, of seeds from 0,"
        " against the compiled core of the reference rig with its shipped limits; the rules are in"
        " `firmware/proofs/world.hpp`. The travel is 3 rad, and 5 degrees more is the rule."
        f" Core {core}.",
    ]
    columns = ("sequences", "run", "rig-hours", "armings", "trips", "farthest, rad", "broken rules")
    rows = []
    for kind, s in searches.items():
        counts = [str(s.sequences), f"{s.hours:.1f}", str(s.armings), str(s.trips)]
        rows.append([kind, *counts, f"{s.farthest_rad:.3f}", str(len(s.found))])
    return to_page(paragraphs, [TextTable("Sequences", columns, rows)], Provenance.now(0))


def main() -> int:
    """Search on until there is as much as asked for."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.hunt", description=__doc__)
    parser.add_argument("--hours", type=float, default=100.0, help="rig-hours with faults, in all")
    parser.add_argument("--commands", type=int, default=1_000_000, help="command sequences, in all")
    parser.add_argument("--again", action="store_true", help="begin from the start")
    options = parser.parse_args()
    subprocess.run(["make", "-C", str(FIRMWARE), "build/hunt"], check=True, stdout=sys.stderr)  # noqa: S603, S607
    core = f"{source_hash() or 0:08x}"
    searches = kept("" if options.again else core)
    with tempfile.TemporaryDirectory() as folder:
        settings = Path(folder) / "settings.bin"
        write_settings(settings)
        while True:
            lacks = {
                "commands": searches["commands"].sequences < options.commands,
                "faults": searches["faults"].hours < options.hours,
            }
            wanted = [kind for kind in lacks if lacks[kind]]
            if not wanted:
                break
            for kind in wanted:
                first = searches[kind].sequences
                more = run(PROGRAM, settings, kind, first, CHUNKS[kind])
                searches[kind] = joined(searches[kind], more)
                for seed, rule, events in more.found:
                    text = f"{kind}, seed {seed}: {rule}: {'; '.join(events[:MOST_EVENTS])}"
                    sys.stderr.write(f"{text}{' ...' if len(events) > MOST_EVENTS else ''}\n")
            state = {"core": core, **{kind: asdict(s) for kind, s in searches.items()}}
            write_text_atomic(STATE, json.dumps(state) + "\n")
            said = ", ".join(f"{s.sequences} {kind}" for kind, s in searches.items())
            sys.stderr.write(f"{said}, {searches['faults'].hours:.1f} rig-hours with faults\n")
    write_text_atomic(PAGE, page(searches, core))
    return 1 if any(s.found for s in searches.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
