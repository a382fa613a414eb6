"""Damage the firmware's core on purpose and see which tests notice.

    python -m benchmarks.core_mutants [--count N] [--list]

Each mutant is one change of one line of `firmware/core`: a comparison, a logical operator, a sign,
a constant, a result, or a statement left out. `--count` of them are drawn over all files by a fixed
seed. Every mutant is held against the unit tests (`firmware/tests/core_test.cpp`), random sequences
(`proofs/hunt.cpp`), the contract tests in Python and the theorems on its file
(`benchmarks.core_proofs`); one that passes all of them against every small input
(`proofs/small.cpp`). A mutant that does not compile does not count. What was found is kept in
`build/core_mutants.json` for this core; the command goes on where it stopped, tries what passed a
test again where that test was changed since, and writes `docs/results/core-mutants.md`.
"""

import argparse
import json
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
import zlib
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.core_proofs import build, decide
from benchmarks.hunt import FIRMWARE, write_settings
from estimation.files import write_text_atomic
from rig.bench.firmware import source_hash
from rig.output.provenance import Provenance
from rig.output.table import TextTable, to_page

ROOT = FIRMWARE.parent
STATE = Path("build/core_mutants.json")
PAGE = Path("docs/results/core-mutants.md")
SEED = 0
LONGEST_S = 120.0
LONGEST_PROOF_S = 600.0
PROOFS_PYTHON = ROOT / ".venv-proofs" / "bin" / "python"
"""The interpreter that `make proofs` installs angr into."""
THEOREMS = {
    "board.hpp": ("board_tick", "board_command"),
    "control.hpp": ("command_limit",),
    "framing.hpp": ("crc_step", "receiver_byte", "cobs_round_trip", "cobs_anything"),
    "limits.hpp": ("limits_within",),
    "motor_guard.hpp": ("heat_limit", "heat_step"),
    "profile_reference.hpp": ("setpoint_allowed", "levels_trip"),
    "session.hpp": ("sequence_window", "board_command"),
    "setpoint_queue.hpp": ("queue_step",),
    "watchdog.hpp": ("watchdog_steps",),
}
"""File of the core to the theorems on it."""
CONTRACTS = ("test_guards.py", "test_sessions.py", "test_teensy_reference.py")
RULES = (
    ("<=", "<"),
    (">=", ">"),
    ("==", "!="),
    ("!=", "=="),
    ("&&", "||"),
    ("||", "&&"),
    ("<", "<="),
    (">", ">="),
    ("+", "-"),
    ("-", "+"),
    ("true", "false"),
    ("false", "true"),
    ("0", "1"),
)
EQUIVALENT = {
    "app.hpp: first_ = last_ = 0; -> first_ = last_ = 1;": "bytes may begin anywhere in the buffer",
    "board.hpp: session_.end();": "a session counts only while the board is armed",
    "board.hpp: std::uint32_t sequence_ = 0;": "the start of a stream sets it",
    "board.hpp: std::size_t staged_count_ = 0;": "each block sets it",
    "board.hpp: std::uint32_t boot_ = 0;": "each start sets it",
    "control.hpp: double limit = 0;": "gains are read before they are used",
    "control.hpp: if (value < -gains_.limit)": "a command at the limit is the limit",
    "encoder_pair.hpp: std::int32_t second_per_turn = 0;": "each arming sets it",
    "encoder_pair.hpp: std::int32_t twist_e6 = 0;": "each arming sets it",
    "encoder_pair.hpp: if (step < -kFastest)": "the fastest step is the fastest",
    "encoder_pair.hpp: std::int64_t least_ = 0;": "the first tick sets it",
    "end_probe.hpp: std::int32_t command_e4 = 0;": "each arming sets it",
    "framing.hpp: const bool good = length_ > 0": "a frame of one byte has no checksum",
    "framing.hpp: std::size_t first_ = 0;": "bytes may begin anywhere in the ring",
    "loop_guard.hpp: std::int64_t far_ticks_ = 0;": "the first target is within its window",
    "loop_guard.hpp: std::int64_t still_mean_ = 0;": "the first tick sets it",
    "loop_guard.hpp: std::int64_t last_motor_ = 0;": "the first tick sets it",
    "loop_guard.hpp: std::int64_t anchor_current_ = 0;": "the first tick sets it",
    "motor_guard.hpp: heat_ = heat_ < 0 ? 0 : least(heat_, kHottest);"
    " -> heat_ = heat_ < 1 ?": "the least whole number above 0 is 1",
    "profile_reference.hpp: return {{0, 0, 0, 0, kFullScaleE4}": "of a board's own gains only the"
    " largest command is read",
    "profile_reference.hpp: std::int32_t target = 0;": "a setpoint is read before it is followed",
    "protocol.hpp: if (value < low)": "a value at the end is the end",
    "protocol.hpp: if (value < INT32_MIN)": "a value at the end is the end",
    "rest_guard.hpp: std::int32_t forward = 0;": "each arming sets it",
    "rest_guard.hpp: std::int32_t torque_e3 = 0;": "each arming sets it",
    "rest_guard.hpp: std::int64_t slow_unfound_ = 0;": "the first tick sets it",
    "rest_guard.hpp: const std::int64_t turned = primed_ ? std::int64_t{counts[0]} - still_at_[0]"
    " : 0; -> const std::int64_t turned = primed_ ? std::int64_t{counts[0]} - still_at_[0]"
    " : 1;": "one count is below the least motion",
    "session.hpp: std::uint32_t boot_ = 0;": "each start sets it",
    "session.hpp: std::uint32_t offers_ = 0;": "each start sets it",
    "session.hpp: std::uint32_t number_ = 0;": "each arming sets it",
    "setpoint_queue.hpp: std::size_t first_ = 0;": "a queue may begin anywhere in its ring",
    "setpoint_queue.hpp: std::size_t used_ = 0;": "each arming clears the queue",
}
"""Beginnings of changes that no input can show, behind their file, and why."""
_STATEMENT = re.compile(r"\s+[\w.\[\]>()*-]+(\s*[-+*|&]?=\s|\(|\+\+|--).*;(\s*//.*)?")
_NO_CODE = re.compile(r"\s*(//|#|\"|static_assert|using|template|constexpr char|namespace|\}|$)")


@dataclass(frozen=True, slots=True)
class Mutant:
    """One change of one file of the core."""

    file: str
    line: int
    before: str
    after: str

    @property
    def name(self) -> str:
        """The change in one line."""
        return (
            f"{self.file}:{self.line}: {self.before.strip()} -> {self.after.strip() or 'nothing'}"
        )


def mutants_of(file: Path) -> Iterator[Mutant]:
    """Yield every change of a file that the rules know."""
    for number, line in enumerate(file.read_text().splitlines(), 1):
        code = line.split("//")[0]
        if _NO_CODE.match(line):
            continue
        for old, new in RULES:
            pattern = rf"(?<=\s){re.escape(old)}(?=\s)"
            if old.isalnum():
                pattern = rf"(?<![\w.'-]){old}(?![\w.'])"
            for match in re.finditer(pattern, code):
                after = f"{code[: match.start()]}{new}{code[match.end() :]}"
                yield Mutant(file.name, number, line, after)
        if _STATEMENT.fullmatch(line) and "return" not in code:
            yield Mutant(file.name, number, line, "")


def drawn(count: int) -> list[Mutant]:
    """Return that many mutants, of every file in turn, in an order that a longer draw keeps."""
    order = random.Random(SEED)
    files = []
    for file in sorted((FIRMWARE / "core").glob("*.hpp")):
        if file.name in ("contract.hpp", "profile_grasper.hpp"):
            continue  # generated; not of this board
        found = list(mutants_of(file))
        order.shuffle(found)
        # a file has as many mutants as it has places for them, in shares of the whole
        files += [((k + 0.5) / len(found), one) for k, one in enumerate(found)]
    files.sort(key=lambda pair: (pair[0], pair[1].name))
    return [one for _, one in files[:count]]


def killers_of(
    mutant: Mutant, folder: Path, known: dict[str, bool], tests: list[str]
) -> dict[str, bool] | None:
    """Return which tests notice a mutant, None where it does not compile.

    `known` of them are not made again; the folder holds a copy of the firmware and the settings.
    """
    known = dict(known)
    source = folder / "core" / mutant.file
    sound = source.read_text()
    lines = sound.splitlines()
    lines[mutant.line - 1] = mutant.after
    source.write_text("\n".join(lines) + "\n")
    try:
        for test in lacking(mutant.name, known, tests):
            if test in LATER and any(known.values()):
                break  # noticed just now
            notices = TESTS[test](folder, folder / "settings.bin")
            if notices is None:
                return None
            known[test] = notices
    finally:
        source.write_text(sound)
    return known


def lacking(name: str, known: dict[str, bool], tests: list[str]) -> list[str]:
    """Return the tests that a mutant is still to be held against."""
    settled = any(known.values()) or any(_is(change, name) for change in EQUIVALENT)
    without = set(LATER) if settled else set[str]()
    if name.partition(":")[0] not in THEOREMS:
        without.add("proofs")
    return [t for t in TESTS if t in tests and t not in known and t not in without]


def _hunt(firmware: Path, settings: Path) -> bool | None:
    program = _built(firmware, "proofs/hunt.cpp", "-O0", "-include", "own.hpp")
    return None if program is None else not all(_passes(program, settings, *w) for w in _HUNTS)


def _unit(firmware: Path, settings: Path) -> bool | None:
    own = ("-O0", "-include", "unit.hpp", "-DRIG_MAIN_APART", "main.o")
    program = _built(firmware, "tests/core_test.cpp", *own)
    return None if program is None else not _passes(program)


def _proofs(firmware: Path, settings: Path) -> bool:
    """Whether a theorem on the changed file can be broken."""
    changed = [f for f in THEOREMS if (firmware / "core" / f).read_text() != _sound(f)]
    if not changed:
        return False
    program = build(firmware)
    if program is None:
        return True
    return any(
        decide(program, name, str(PROOFS_PYTHON), LONGEST_PROOF_S).broken
        for name in THEOREMS[changed[0]]
    )


def _sound(file: str) -> str:
    return (FIRMWARE / "core" / file).read_text()


def _small(firmware: Path, settings: Path) -> bool:
    program = _built(firmware, "proofs/small.cpp", "-O1")
    return program is None or not _passes(program, settings, "3")


_HUNTS = (("commands", "0", "400", "1"), ("faults", "100", "40", "1"))
_HEADERS = {
    "own.hpp": ("algorithm", "array", "cmath", "cstring", "deque", "fstream", "vector"),
    "unit.hpp": ("doctest/doctest.h", "array", "cmath", "cstring", "fstream", "vector"),
}


def _built(firmware: Path, source: str, *flags: str) -> Path | None:
    program = firmware / "program"
    program.unlink(missing_ok=True)
    done = _compiled(firmware, source, *flags, "-o", str(program))
    return program if done == 0 else None


def _compiled(folder: Path, *words: str) -> int:
    command = ["g++", "-std=c++17", "-w", "-ffp-contract=off", *words]
    return subprocess.run(command, cwd=folder, capture_output=True, check=False).returncode  # noqa: S603


def prepare(folder: Path) -> None:
    """Compile what every mutant shares: the headers of others, and the unit tests' main program."""
    for file, names in _HEADERS.items():
        (folder / file).write_text("".join(f"#include <{name}>\n" for name in names))
    (folder / "main.cpp").write_text(
        "#define DOCTEST_CONFIG_IMPLEMENT_WITH_MAIN\n#include <doctest/doctest.h>\n"
    )
    parts = [("-x", "c++-header", file) for file in _HEADERS] + [("-c", "main.cpp")]
    if any(_compiled(folder, "-O0", *words) for words in parts):
        raise RuntimeError("g++ and doctest (apt-get install doctest-dev) are needed")


def _passes(program: Path, *words: object) -> bool:
    """Whether a program ends well; one that does not end is noticed."""
    try:
        done = subprocess.run(  # noqa: S603
            [str(program), *map(str, words)], capture_output=True, check=False, timeout=LONGEST_S
        )
    except subprocess.TimeoutExpired:
        return False
    return done.returncode == 0


def _contract(firmware: Path, settings: Path) -> bool:
    """Whether the contract tests in Python notice the library of a changed core."""
    library = _built(firmware, "host/rig_board.cpp", "-O1", "-fPIC", "-shared")
    if library is None:
        return True
    tests = [str(ROOT / "tests" / "drivers" / test) for test in CONTRACTS]
    words = [sys.executable, "-m", "pytest", "-q", "-x", "-n", "0", *tests]
    own = {"RIG_FIRMWARE_LIBRARY": str(library)}
    try:
        done = subprocess.run(  # noqa: S603
            words, cwd=ROOT, capture_output=True, check=False, env=os.environ | own,
            timeout=LONGEST_S,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return True
    return done.returncode != 0


TESTS: dict[str, Callable[[Path, Path], bool | None]] = {
    "unit": _unit,
    "hunt": _hunt,
    "contract": _contract,
    "proofs": _proofs,
    "small": _small,
}
"""What a mutant is held against, in order."""
LATER = ("small",)
"""Tests of a mutant that no test before them noticed."""


def forget_changed(state: dict[str, Any]) -> dict[str, str]:
    """Forget which mutants passed a test whose sources are others now; return their checksums."""
    sources = {
        "unit": [*(FIRMWARE / "tests").glob("*.*"), FIRMWARE / "proofs" / "world.hpp"],
        "hunt": [FIRMWARE / "proofs" / name for name in ("hunt.cpp", "world.hpp")],
        "proofs": [
            *(FIRMWARE / "proofs").glob("symbolic*"),
            FIRMWARE / "proofs" / "any_profile.hpp",
        ],
        "contract": [ROOT / "tests" / "drivers" / name for name in CONTRACTS],
        "small": [FIRMWARE / "proofs" / name for name in ("small.cpp", "world.hpp")],
    }
    sums = {
        test: f"{zlib.crc32(b''.join(p.read_bytes() for p in sorted(paths))):08x}"
        for test, paths in sources.items()
    }
    for test, value in sums.items():
        if state.get("tests", {}).get(test) != value:
            for known in state.get("results", {}).values():
                if known is not None and known.get(test) is False:
                    del known[test]
    return sums


def _is(change: str, name: str) -> bool:
    """Whether a change of `EQUIVALENT` is the mutant of this name."""
    return re.sub(r":\d+:", ":", name, count=1).startswith(change)


def page(results: dict[str, dict[str, bool] | None], core: str) -> str:
    """Return the page of which tests noticed which mutants."""
    tried = {name: found for name, found in results.items() if found is not None}
    killed = {name: [test for test, hit in found.items() if hit] for name, found in tried.items()}
    count = Counter(test for tests in killed.values() for test in tests)
    alone = Counter(tests[0] for tests in killed.values() if len(tests) == 1)
    unseen = [name for name, tests in killed.items() if not tests]
    alike = {n: why for n in unseen for change, why in EQUIVALENT.items() if _is(change, n)}
    lived = [name for name in unseen if name not in alike]
    unfinished = sum(bool(lacking(name, tried[name], [*TESTS])) for name in lived)
    total = max(1, len(tried))
    noticed = sum(bool(tests) for tests in killed.values())
    asked = Counter(test for found in tried.values() for test in found)
    paragraphs = [
        "Mutants of the core",
        "Written by `make mutants-core`, which goes on where it stopped. Each mutant is one change"
        " of one line of `firmware/core`, drawn by a fixed seed. Unit tests, random sequences and"
        " contract tests see every mutant, the theorems those of the files that have some, in the"
        " order of the list as far as they have come. Every small input is for the rest.",
        f"Core {core}. {len(tried)} mutants tried, {noticed} noticed ({noticed / total:.0%}),"
        f" {len(alike)} equivalent; {len(results) - len(tried)} did not compile. Of those not"
        f" noticed, {unfinished} have not yet been held against every test.",
    ]
    names = {
        "unit": "unit tests in C++",
        "hunt": "random sequences",
        "contract": "contract tests in Python",
        "proofs": "theorems for all values",
        "small": "every small input",
    }
    rows = []
    for test, title in names.items():
        share = count[test] / asked[test] if asked[test] else 0.0
        rows.append([title, str(asked[test]), str(count[test]), f"{share:.0%}", str(alone[test])])
    columns = ("tests", "mutants seen", "noticed", "share of those seen", "by nothing before")
    missed = [
        [f"`{name}`", "to be tried" if lacking(name, tried[name], [*TESTS]) else "not noticed"]
        for name in sorted(lived)
    ]
    missed += [[f"`{name}`", why] for name, why in alike.items()]
    tables = [
        TextTable("Tests", columns, rows),
        TextTable("Not noticed", ("mutant", "why"), missed, "The others are equivalent."),
    ]
    return to_page(paragraphs, tables, Provenance.now(SEED))


def main() -> int:
    """Try the mutants that have not been tried on this core."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.core_mutants", description=__doc__)
    parser.add_argument("--count", type=int, default=200, help="mutants drawn")
    parser.add_argument("--tests", nargs="+", choices=list(TESTS), default=list(TESTS))
    parser.add_argument("--list", action="store_true", help="name them and try none")
    options = parser.parse_args()
    if "proofs" in options.tests and not PROOFS_PYTHON.exists():
        parser.error("no angr: make proofs installs it; or --tests unit hunt contract small")
    mutants = drawn(options.count)
    if options.list:
        sys.stdout.write("".join(f"{mutant.name}\n" for mutant in mutants))
        return 0
    core = f"{source_hash() or 0:08x}"
    state = json.loads(STATE.read_text()) if STATE.is_file() else {}
    sums = forget_changed(state)
    results = state.get("results", {}) if state.get("core") == core else {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "firmware"
        for part in ("core", "boards", "host", "proofs", "tests"):
            shutil.copytree(FIRMWARE / part, folder / part)
        shutil.copy(FIRMWARE / "Makefile", folder)
        write_settings(folder / "settings.bin")
        prepare(folder)
        for mutant in mutants:
            known = results.get(mutant.name, {})
            if known is None or not lacking(mutant.name, known, options.tests):
                continue
            results[mutant.name] = killers_of(mutant, folder, known, options.tests)
            write_text_atomic(
                STATE, json.dumps({"core": core, "tests": sums, "results": results}) + "\n"
            )
            found = results[mutant.name]
            said = "does not compile" if found is None else ", ".join(k for k in found if found[k])
            sys.stderr.write(f"{mutant.name}: {said or 'NOT NOTICED'}\n")
            write_text_atomic(PAGE, page(results, core))
    return 0


if __name__ == "__main__":
    sys.exit(main())
