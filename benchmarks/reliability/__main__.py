"""Measure how reliable the rig is and write the table.

`python -m benchmarks.reliability [soak pty canopen faults encoders kills network fuzz]
[--virtual S] [--real S] [--canopen S] [--faults N] [--rides N] [--kills N]`: the parts named,
all if none. Each part's figures are kept in `build/reliability.json`, and the table is written from
all that are there. A part that was not measured in this checkout keeps the rows it has in the
table; one that never was says so. A run with less than a part's goal is a short one: its figures
and its table stay apart, in `build/reliability-short.*`, and the committed table is not touched.
Fuzzing goes on where it stopped, so its rows are written when the plan is done, or when a decoder
has failed.
"""

import argparse
import json
import math
import re
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.reliability import dead_encoders, faults, fuzz, kills, listening, soak
from drivers.teensy.protocol import Trip
from estimation.files import write_text_atomic
from rig.output.provenance import Provenance

SEED = 0
STATE = Path("build/reliability.json")
TABLE = Path("docs/results/reliability.md")
SHORT_STATE = Path("build/reliability-short.json")
SHORT_TABLE = Path("build/reliability-short.md")
SAFE_S, WATCHDOG_S = 0.020, 0.052
FARTHEST_RAD = math.radians(5.0)

Figures = dict[str, Any]
Row = tuple[str, str, str, str]
"""Figure, what was measured, goal, and whether it was met."""


@dataclass(frozen=True)
class Part:
    """What is measured by itself.

    Attributes:
        unmeasured: Its figure while it was never measured.
        begins: Pattern of how the figures of its rows begin.
        measure: Measures it as the command line asks.
        rows: Makes the rows of its figures.
        option: Option that says how much of it is measured; empty without one.
        goal: Its goal, in the unit of the option.
    """

    unmeasured: str
    begins: str
    measure: Callable[[argparse.Namespace], Figures]
    rows: Callable[[Figures], list[Row]]
    option: str = ""
    goal: int = 0


def main() -> int:
    """Measure the parts asked for and write the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.reliability", description=__doc__)
    parser.add_argument("parts", nargs="*", metavar="PART", help=", ".join(PARTS))
    parser.add_argument("--virtual", type=float, default=3600.0, help="virtual seconds")
    parser.add_argument("--real", type=float, default=600.0, help="real seconds on a pty")
    parser.add_argument("--canopen", type=float, default=60.0, help="real seconds on a CAN bus")
    parser.add_argument("--faults", type=int, default=1000, help="faults injected")
    parser.add_argument("--rides", type=int, default=640, help="motions whose encoders die")
    parser.add_argument("--kills", type=int, default=200, help="recorders killed")
    options = parser.parse_intermixed_args()
    unknown = set(options.parts) - set(PARTS)
    if unknown:
        parser.error(f"unknown part {', '.join(sorted(unknown))}")
    asked = {name: PARTS[name] for name in options.parts or PARTS}
    short = any(p.option and getattr(options, p.option) < p.goal for p in asked.values())
    state, table = (SHORT_STATE, SHORT_TABLE) if short else (STATE, TABLE)
    for name, part in asked.items():
        sys.stderr.write(f"{name} ...\n")
        figures, now = part.measure(options), Provenance.now(SEED)
        made = {"made": f"{now.date}, {now.commit}, {now.seed}"}
        write_text_atomic(
            state, json.dumps({**_kept(state), name: figures | made}, indent=1) + "\n"
        )
    earlier = TABLE.read_text() if TABLE.is_file() else ""
    write_text_atomic(table, written(_kept(state), earlier))
    why = f"; a short run, {TABLE} is as it was" if short else ""
    sys.stderr.write(f"Written: {table}{why}\n")
    return 0


def _kept(state: Path) -> dict[str, Figures]:
    """Return the figures of every part that was ever measured."""
    figures: dict[str, Figures] = json.loads(state.read_text()) if state.is_file() else {}
    return figures


def written(figures: dict[str, Figures], earlier: str) -> str:
    """Return the page; parts without figures keep their rows of the earlier one."""
    tallies = fuzz.load(fuzz.STATE)
    done = sum(tally.inputs for tally in tallies.values())
    fuzzed = done >= fuzz.TOTAL or any(tally.failures for tally in tallies.values())
    if fuzzed:
        figures = {"fuzz": {}} | figures
    summary, _, decoders = earlier.partition("## Fuzzed decoders")
    rows = []
    for name, part in PARTS.items():
        kept = [] if name in figures else _rows(summary, part.begins)
        new: list[Row] = [(part.unmeasured, "not measured", "", "**no**")]
        if name in figures or name == "fuzz":
            new = part.rows(figures.get(name, {}))
        made = figures.get(name, {}).get("made", "")
        rows += kept or [f"| {' | '.join(cells)} | {made} |" for cells in new]
    lines = [
        "# Reliability",
        "",
        "Written by `make soak` and `make fuzz`; each command writes the rows it measured. The"
        " machine was shared with other work; a missed goal is said as missed.",
        "",
        "| figure | measured | goal | met | date, commit, seed |",
        "|---|---|---|---|---|",
        *rows,
        "",
        "## Fuzzed decoders",
        "",
        "An accepted input is held against an oracle: another implementation of the checksum, or"
        " the encoder. A refusal is an error of the project's own.",
        "",
        "| decoder | inputs | planned | accepted | refused | slowest ms | failures |",
        "|---|---:|---:|---:|---:|---:|---:|",
        *(_decoder_rows(tallies) if fuzzed else _rows(decoders, r"[^|]*\| \d")),
    ]
    return "\n".join([*lines, "", Provenance.now(SEED).line(), ""])


def _rows(text: str, begins: str) -> list[str]:
    """Return the rows of a table whose first cell begins so."""
    return [line for line in text.splitlines() if re.match(rf"\| (?:{begins})", line)]


def _decoder_rows(tallies: dict[str, fuzz.Tally]) -> list[str]:
    wanted = fuzz.plan(fuzz.TOTAL)
    rows = []
    for name, t in tallies.items():
        counts = f"{t.inputs} | {wanted[name]} | {t.accepted} | {t.refused}"
        rows.append(f"| {name} | {counts} | {1e3 * t.slowest_s:.0f} | {len(t.failures)} |")
    return rows


def _row(what: str, measured: str, goal: str, met: bool) -> Row:
    return what, measured, goal, "yes" if met else "**no**"


def _soak_rows(s: Figures, goal_s: int) -> list[Row]:
    where, speed = s["where"], s["duration_s"] / s["elapsed_s"]
    trip = f"; ended by a trip: {s['trip']}" if s.get("trip") else ""
    lost = _row(
        f"{where}: samples lost",
        f"{s['lost']} of {s['samples']} in {s['duration_s']:.0f} s; link troubles:"
        f" {s['troubles']}{trip}",
        f"0 in {goal_s} s, with the watchdog of a real rig (50 ms)",
        s["lost"] == 0 and s["duration_s"] >= 0.99 * goal_s,
    )
    if where.endswith("virtual time"):
        return [lost, (f"{where}: speed", f"{speed:.0f} times real time", "", "")]
    p50, p99, p999, top = s["latency_ms"] or [np.nan] * 4
    latency = f"{p50:.2f} / {p99:.2f} / {p999:.2f} / {top:.2f} ms"
    longest, computed, waited = s["pause_ms"]
    pause = f"{longest:.1f} ms; of it {computed:.1f} ms computing, {waited:.1f} ms without"
    share = f"{100 * s['processor_ratio']:.1f} % of a core"
    return [
        lost,
        _row(f"{where}: pace", f"{speed:.3f} times real time", "1", speed > 0.99),
        (f"{where}: latency p50 / p99 / p99.9 / max", latency, "", ""),
        (f"{where}: longest pause between two commands", f"{pause} processor", "", ""),
        _row(f"{where}: reader", share, "under 10 %", s["processor_ratio"] < 0.1),
    ]


def _soak(name: str, config: str, option: str, goal_s: int, where: str) -> Part:
    def measure(options: argparse.Namespace) -> Figures:
        return asdict(soak.soak(config, getattr(options, option), where))

    return Part(name, where, measure, lambda s: _soak_rows(s, goal_s), option, goal_s)


def _faults(options: argparse.Namespace) -> Figures:
    outcomes = list(faults.inject(options.faults))
    silence = ("host killed", "cable cut")
    safe = [o for o in outcomes if o.safe_after_s is not None and o.kind not in silence]
    silent = [o for o in outcomes if o.kind in silence]
    return {
        "count": len(outcomes),
        "kinds": len({o.kind for o in outcomes}),
        "detected": sum(o.detected for o in outcomes),
        "named": sum(o.named for o in outcomes),
        "mis_stamped": sum(o.mis_stamped for o in outcomes),
        "crashes": sum(bool(o.crash) for o in outcomes),
        "trips": len(safe),
        "slowest_safe_s": max(o.safe_after_s or 0.0 for o in safe),
        "silences": len(silent),
        "slowest_silent_s": max(
            np.inf if o.safe_after_s is None else o.safe_after_s for o in silent
        ),
        "missed": sorted({f"{o.kind} {o.crash}".strip() for o in outcomes if not o.named}),
    }


def _fault_rows(f: Figures) -> list[Row]:
    total = f["count"]
    missed = f"; not named: {'; '.join(f['missed'])}" if f["missed"] else ""
    return [
        _row(
            f"{total} faults of {f['kinds']} kinds: detected, named",
            f"{f['detected']}, {f['named']}{missed}",
            "all detected",
            f["detected"] == total >= 1000,
        ),
        _row("samples mis-stamped", str(f["mis_stamped"]), "0", f["mis_stamped"] == 0),
        _row("crashes", str(f["crashes"]), "0", f["crashes"] == 0),
        _row(
            f"{f['trips']} trips: slowest way to the safe state, after the time a fault may last",
            f"{1e3 * f['slowest_safe_s']:.1f} ms",
            "20 ms",
            f["slowest_safe_s"] <= SAFE_S,
        ),
        _row(
            f"{f['silences']} dead hosts and cut cables: slowest",
            f"{1e3 * f['slowest_silent_s']:.1f} ms",
            "the watchdog's 50 ms and a tick or two",
            f["slowest_silent_s"] <= WATCHDOG_S,
        ),
    ]


def _encoders(options: argparse.Namespace) -> Figures:
    """Half of the motions begin in the last 0.4 rad and are slow; a quarter as many are sound."""
    dead = [dead_encoders.ride(k // 2, slow=k % 2 == 0) for k in range(options.rides)]
    sound = [dead_encoders.ride(k, dead=False).trip for k in range(options.rides // 4)]
    return {
        "count": len(dead),
        "farthest_rad": max(ride.beyond_rad for ride in dead),
        "beyond": sum(ride.beyond_rad > FARTHEST_RAD for ride in dead),
        "sound": len(sound),
        "false": sum(trip is Trip.ENCODER_FROZEN for trip in sound),
    }


def _encoder_rows(e: Figures) -> list[Row]:
    return [
        _row(
            f"{e['count']} motions with all encoders dying on the way: beyond the travel",
            f"{e['beyond']} by more than 5 degrees; farthest {e['farthest_rad']:.3f} rad",
            "none by more than 5 degrees",
            e["beyond"] == 0,
        ),
        _row(
            f"{e['sound']} motions with all encoders sound: taken for dead",
            str(e["false"]),
            "0",
            e["false"] == 0,
        ),
    ]


def _kills(options: argparse.Namespace) -> Figures:
    killed = kills.kill_many(options.kills)
    lost_s = [one.lost_s for one in killed]
    return {
        "count": len(killed),
        "most_lost_s": max(lost_s),
        "median_lost_s": float(np.median(lost_s)),
    }


def _kill_rows(k: Figures) -> list[Row]:
    told = f"most {k['most_lost_s']:.3f} s, median {k['median_lost_s']:.3f} s"
    met = k["most_lost_s"] <= 0.25 and k["count"] >= 200
    what = f"{k['count']} recorders killed: lost, all files repaired, nothing earlier changed"
    return [_row(what, told, "0.25 s in 200", met)]


def _network_rows(n: Figures) -> list[Row]:
    unasked, asked = n["unasked"], n["asked"]
    inside = all(listening.is_loopback(address) for address in asked)
    rigs = ", ".join(listening.CONFIGS)
    return [
        _row(
            f"listening sockets of `rig live` on {rigs}, and of `rig record`",
            ", ".join(unasked) or "none",
            "none",
            not unasked,
        ),
        _row(
            "listening sockets of `rig live --foxglove`",
            f"{len(asked)}, {'loopback only' if inside else 'not loopback: ' + ', '.join(asked)}",
            "1, loopback only",
            len(asked) == 1 and inside,
        ),
    ]


def _fuzz_rows(_: Figures) -> list[Row]:
    """Return the row of what the fuzzing's own command has kept."""
    tallies = fuzz.load(fuzz.STATE)
    done = sum(t.inputs for t in tallies.values())
    bad = sum(len(t.failures) for t in tallies.values())
    least = min(t.inputs for t in tallies.values())
    told = f"{done} inputs, at least {least} each, {bad} failures"
    met = done >= fuzz.TOTAL and least >= fuzz.LEAST and not bad
    return [_row("fuzzed decoders", told, "10 million, 100,000 each, 0 failures", met)]


PARTS = {
    "soak": _soak("soak", "simulated", "virtual", 3600, "firmware core, virtual time"),
    "pty": _soak("pty", "pty", "real", 600, "firmware process on a pty, real time"),
    "canopen": _soak(
        "canopen", "canopen_virtual", "canopen", 60, "EPOS4 fake on a virtual CAN bus, real time"
    ),
    "faults": Part(
        "injected faults",
        r"\d+ faults |samples mis-stamped|crashes|\d+ trips: |\d+ dead hosts ",
        _faults,
        _fault_rows,
        "faults",
        1000,
    ),
    "encoders": Part(
        "encoders that all die",
        r"\d+ motions with all encoders ",
        _encoders,
        _encoder_rows,
        "rides",
        640,
    ),
    "kills": Part("killed recorders", r"\d+ recorders killed", _kills, _kill_rows, "kills", 200),
    "network": Part(
        "listening sockets", r"listening ", lambda o: listening.measure(), _network_rows
    ),
    "fuzz": Part("", r"fuzzed decoders", lambda o: {}, _fuzz_rows),
}


if __name__ == "__main__":
    sys.exit(main())
