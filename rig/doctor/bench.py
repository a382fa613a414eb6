"""What cannot be shown without a bench: the tests a person should make, and what each must show."""

import tomllib
from dataclasses import dataclass
from pathlib import Path

FILE = Path(__file__).with_name("bench.toml")

HEAD = """\
# What needs a bench

Everything else about this program is shown without hardware: on fakes, on a simulated rig, in an
emulated processor, and by the [checks of the core](safety-core.md). The tests below cannot be made
so. Nobody has made them for you: until a person has, on your bench, their results are not known.

Work with one hand on the emergency stop, the instrument out, and travel limits well inside the
stops. `rig selftest --bench` prints this list after its own checks; keep it with your notes.
"""


@dataclass(frozen=True, slots=True)
class BenchTest:
    """One test for a person with a bench: why nothing else shows it, what to do, what it shows."""

    name: str
    why: str
    do: str
    shows: str


def bench_tests() -> list[BenchTest]:
    """Return the tests, in the order in which they are made."""
    return [BenchTest(**test) for test in tomllib.loads(FILE.read_text("utf-8"))["tests"]]


def page() -> str:
    """Return the page of the tests."""
    parts = [HEAD]
    for number, test in enumerate(bench_tests(), 1):
        parts += [
            f"## {number}. {test.name}\n",
            f"- Why: {test.why}",
            f"- Do: {test.do}",
            f"- Must show: {test.shows}\n",
        ]
    return "\n".join(parts)
