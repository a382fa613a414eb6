"""Throw random and mutated inputs at every decoder; go on where an earlier run stopped.

`python -m benchmarks.reliability.fuzz [--seconds S] [--total N] [--state FILE]`: each decoder gets
its share of the total; a block of inputs is made from its number alone, so a failure is repeatable.
"""

import argparse
import faulthandler
import json
import random
import sys
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path

from benchmarks.reliability.targets import REFUSALS, TARGETS, Target
from estimation.files import write_text_atomic

BLOCK = 1000
TOTAL = 10_000_000
LEAST = 100_000
HANGS_S = 60
KEPT_FAILURES = 20
STATE = Path("build/fuzz.json")


@dataclass
class Tally:
    """What came of one decoder so far; `failures` holds block, input and reason."""

    inputs: int = 0
    accepted: int = 0
    refused: int = 0
    slowest_s: float = 0.0
    failures: list[tuple[int, str, str]] = field(default_factory=list)


def main() -> int:
    """Fuzz for a while; exit 1 when any decoder failed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=float("inf"), help="stop after this time")
    parser.add_argument("--total", type=int, default=TOTAL, help="inputs in all, resumed ones too")
    parser.add_argument("--state", type=Path, default=STATE, help="where the tally is kept")
    options = parser.parse_args()
    tallies = load(options.state)
    end_s = time.monotonic() + options.seconds
    wanted = plan(options.total)
    for name, tally in _turns(tallies, wanted, end_s):
        save(options.state, tallies)
        sys.stderr.write(f"{name}: {tally.inputs} of {wanted[name]}, {len(tally.failures)} bad\n")
    done = sum(tally.inputs for tally in tallies.values())
    bad = sum(len(tally.failures) for tally in tallies.values())
    sys.stderr.write(f"{done} inputs in all, {bad} failures, tally in {options.state}\n")
    return 1 if bad else 0


def plan(total: int) -> dict[str, int]:
    """Return how many inputs each decoder is to get, in whole blocks."""
    least = min(LEAST, total // len(TARGETS))
    rest = total - least * len(TARGETS)
    shares = sum(target.share for target in TARGETS)
    return {
        target.name: -(-(least + rest * target.share // shares) // BLOCK) * BLOCK
        for target in TARGETS
    }


def load(path: Path) -> dict[str, Tally]:
    """Return the tally of every decoder, empty where there is none yet."""
    kept = json.loads(path.read_text()) if path.is_file() else {}
    return {target.name: Tally(**kept.get(target.name, {})) for target in TARGETS}


def save(path: Path, tallies: dict[str, Tally]) -> None:
    """Keep the tally, so that a later run goes on."""
    kept = {name: asdict(tally) for name, tally in tallies.items()}
    write_text_atomic(path, json.dumps(kept, indent=1) + "\n")


def run_block(target: Target, number: int, tally: Tally, size: int = BLOCK) -> None:
    """Run one block of inputs, made from its number alone."""
    generator = random.Random(f"{target.name}:{number}")
    seeds = target.seeds()
    for _ in range(size):
        data = mutated(generator, seeds)
        began_s = time.perf_counter()
        try:
            if target.run(data):
                tally.accepted += 1
        except REFUSALS:
            tally.refused += 1
        except Exception as error:
            if len(tally.failures) < KEPT_FAILURES:
                reason = f"{type(error).__name__}: {error}"
                tally.failures.append((number, data.hex()[:2000], reason[:300]))
        tally.slowest_s = max(tally.slowest_s, time.perf_counter() - began_s)
        tally.inputs += 1


def mutated(generator: random.Random, seeds: list[bytes]) -> bytes:
    """Return noise, or a good input with one to four things done to it."""
    if generator.random() < 0.15:
        return generator.randbytes(generator.randrange(80))
    data = bytearray(generator.choice(seeds))
    for _ in range(generator.randint(1, 4)):
        place = generator.randrange(len(data) + 1)
        kind = generator.randrange(6)
        if kind == 0 and place < len(data):
            data[place] ^= 1 << generator.randrange(8)
        elif kind == 1 and place < len(data):
            data[place] = generator.choice((0, 1, 0x7F, 0x80, 0xFF, generator.randrange(256)))
        elif kind == 2:
            data[place:place] = generator.randbytes(generator.randint(1, 8))
        elif kind == 3:
            del data[place : place + generator.randint(1, 8)]
        elif kind == 4:
            data[place:place] = data[place : place + generator.randint(1, 40)]
        else:
            other = generator.choice(seeds)
            data[place:] = other[generator.randrange(len(other) + 1) :]
    return bytes(data)


def _turns(
    tallies: dict[str, Tally], wanted: dict[str, int], end_s: float
) -> Iterator[tuple[str, Tally]]:
    """Give the decoders blocks in turn; one whose process hangs is ended with a traceback."""
    busy = True
    while busy and time.monotonic() < end_s:
        busy = False
        for target in TARGETS:
            tally = tallies[target.name]
            turn = max(1, target.share)
            for _ in range(turn):
                if tally.inputs >= wanted[target.name] or time.monotonic() > end_s:
                    break
                faulthandler.dump_traceback_later(HANGS_S, exit=True)
                run_block(target, tally.inputs // BLOCK, tally)
                faulthandler.cancel_dump_traceback_later()
                busy = True
            yield target.name, tally


if __name__ == "__main__":
    sys.exit(main())
