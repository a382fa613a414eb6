"""What cannot be shown without a bench: the tests a person should make, and what each must show."""

import tomllib
from dataclasses import dataclass
from pathlib import Path

FILE = Path(__file__).with_name("bench.toml")


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
