"""An archive of simulated campaigns: index, search, a fit of each, and changes over time.

`python -m benchmarks.archive [--campaigns N,...] [--runs N] [--diagnosed N] [--out FILE]` writes
archives of some sizes into a temporary folder, times each step with one process, two processes and
a Dask cluster of two workers of this machine, ends a worker during the last one, and counts the
changes found. A few campaigns of more runs are diagnosed.
"""

import argparse
import multiprocessing
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from estimation.files import write_text_atomic
from estimation.model_file import read, to_toml
from rig.campaigns.drift import changes
from rig.campaigns.index import campaigns
from rig.campaigns.refit import refit_all
from rig.campaigns.search import search
from rig.campaigns.work import Start, engine
from rig.log.convert import write_recording
from rig.output.provenance import Provenance
from rig.output.table import TextTable, to_page
from rig.reports.diagnosed import diagnose_all
from rig.simulation.campaign import simulate_reference_campaign
from rig.simulation.parameters import PlantParameters

SIZES, RUNS = (100, 300, 1000), 2
DIAGNOSED, RUNS_TO_DIAGNOSE = 6, 10
DAY_NS = 86_400_000_000_000
START_NS = 1_750_000_000_000_000_000
CHANGED_AT = {"torque_constant_n_m_a": (0.4, 0.93), "motor_friction_n_m": (0.7, 1.3)}
"""Parameter to the share of the archive after which it is multiplied, and by what."""
SCATTER = 0.01
"""Spread of every changed parameter from campaign to campaign, relative."""
MODEL = "motor"
FOUND_AS = {
    "torque_constant_n_m_a": "motor.torque_constant.gain",
    "motor_friction_n_m": "friction.coulomb.friction",
}
QUERY = ("SIM-TOOL-1", "date>=2025-06-20", "load_command_a>=0.5")


def write_archive(root: Path, count: int, runs: int) -> float:
    """Write campaigns of one rig, one a day; return their bytes."""
    random = np.random.default_rng(0)
    size = 0
    for day in range(count):
        own = PlantParameters()
        for name, (share, factor) in CHANGED_AT.items():
            value = getattr(own, name) * (1 + SCATTER * random.normal())
            own = replace(own, **{name: value * (factor if day >= share * count else 1.0)})
        whole = simulate_reference_campaign(day, parameters=own)
        folder = root / f"{day:04}"
        folder.mkdir(parents=True)
        for k in random.choice(len(whole), runs, replace=False):
            run = whole.runs[k].recording()
            started = START_NS + day * DAY_NS + int(k) * 60_000_000_000
            path = folder / f"{run.name.replace(' ', '-')}.mcap"
            write_recording(path, replace(run, started_at_ns=started))
            size += path.stat().st_size
    return size


def clear(root: Path) -> None:
    """Delete the kept fits of an archive."""
    for path in root.glob("*/fit/*.json"):
        path.unlink()


@contextmanager
def dask() -> Iterator[Executor | None]:
    """Yield two Dask workers of this machine."""
    import distributed  # the extra `cluster`

    made: Any = distributed.LocalCluster
    with (
        made(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        engine(scheduler=cluster.scheduler_address) as executor,
    ):
        yield executor


def timed(root: Path, start: Start) -> float:
    """Return the seconds that a fit of every campaign takes."""
    clear(root)
    begun = time.monotonic()
    refit_all(folders(root), to_toml(read(Path(MODEL))), start)
    return time.monotonic() - begun


def folders(root: Path) -> list[Path]:
    """Return the campaigns, oldest first."""
    return sorted(path for path in root.iterdir() if path.is_dir())


def with_a_lost_worker(root: Path) -> tuple[int, int]:
    """Fit all in two processes, end one after a third; return campaigns and fits done again."""
    clear(root)
    done: list[Path] = []

    def on_done(folder: Path) -> None:
        done.append(folder)
        if len(done) == len(every) // 3:
            multiprocessing.active_children()[0].kill()

    every = folders(root)
    found = refit_all(every, to_toml(read(Path(MODEL))), partial(engine, 2), on_done)
    return len(found), len(done) - len(set(done))


def found_changes(root: Path) -> list[list[str]]:
    """Return a row for each change found in any parameter."""
    every = folders(root)
    fits = refit_all(every, to_toml(read(Path(MODEL))), engine)
    planted = {FOUND_AS[name]: value for name, value in CHANGED_AT.items()}
    rows = []
    for name in next(iter(fits.values())).values:
        share, factor = planted.pop(name, (None, None))
        true = "none" if share is None else f"{factor:g} at {int(np.ceil(share * len(every)))}"
        moved = changes([fit.values[name] for fit in fits.values()])
        told = ", ".join(f"{one.after / one.before:.3g} at {one.first}" for one in moved)
        rows.append([name, true, told or "none", str(moved[0].alarm) if moved else ""])
    return rows


def diagnosed(count: int) -> list[list[str]]:
    """Return a row of times for each way to diagnose so many campaigns."""
    rows = []
    with tempfile.TemporaryDirectory(prefix="rig-archive-") as place:
        root = Path(place) / "logs"
        write_archive(root, count, RUNS_TO_DIAGNOSE)
        for name, start in {
            "one process": engine,
            "two processes": partial(engine, 2),
            "two Dask workers": dask,
        }.items():
            for path in root.glob("*/diagnosis/*"):
                path.unlink()
            begun = time.monotonic()
            done = diagnose_all(folders(root), Path(place) / f"{name}.jsonl", start)
            seconds = time.monotonic() - begun
            good = sum(not one.failed for one in done.values())
            rows.append([name, f"{good} of {count}", f"{seconds:.0f}", f"{seconds / count:.1f}"])
    return rows


def measure(sizes: list[int], runs: int) -> tuple[list[list[str]], list[list[str]], str]:
    """Return the rows of times, those of changes, and a sentence on the lost worker."""
    rows = []
    for count in sizes:
        with tempfile.TemporaryDirectory(prefix="rig-archive-") as place:
            root, index = Path(place) / "logs", Path(place) / "index.json"
            size = write_archive(root, count, runs)
            begun = time.monotonic()
            whole = campaigns(root, index)
            read_s, begun = time.monotonic() - begun, time.monotonic()
            hits = search(campaigns(root, index), QUERY)
            query_s = time.monotonic() - begun
            seconds = [timed(root, start) for start in (engine, partial(engine, 2), dask)]
            row = [str(len(whole)), str(count * runs), f"{size / 1e6:.0f}", f"{read_s:.2f}"]
            row += [f"{query_s:.2f}", str(sum(len(c.runs) for c in hits))]
            rows.append([*row, *(f"{s:.1f}" for s in seconds), f"{seconds[0] / count:.2f}"])
            if count == max(sizes):
                every, again = with_a_lost_worker(root)
                moved = found_changes(root)
    lost = (
        f"One of two processes was ended after a third of {every} campaigns: all {every} have a"
        f" fit, {again} of the kept ones was made again."
    )
    return rows, moved, lost


def main() -> int:
    """Measure, and write the page."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.archive", description=__doc__)
    parser.add_argument("--campaigns", default=",".join(map(str, SIZES)), metavar="N,...")
    parser.add_argument("--runs", type=int, default=RUNS, help="runs of a campaign, 20 s each")
    parser.add_argument(
        "--diagnosed", type=int, default=DIAGNOSED, help="campaigns that are diagnosed"
    )
    parser.add_argument("--out", type=Path)
    asked = parser.parse_args()
    rows, moved, lost = measure([int(n) for n in asked.campaigns.split(",")], asked.runs)
    columns = ["campaigns", "runs", "MB", "index, s", "search, s", "runs found"]
    columns += ["fit, one process, s", "two processes, s", "two Dask workers, s", "s a campaign"]
    tables = [
        TextTable("Times by size", columns, rows, f"Searched for: {' '.join(QUERY)}. {lost}"),
        TextTable(
            "Changes found in the largest",
            ["parameter", "planted: factor at campaign", "found", "alarm at"],
            moved,
        ),
        TextTable(
            f"Campaigns of {RUNS_TO_DIAGNOSE} runs diagnosed",
            ["by", "diagnosed", "s", "s a campaign"],
            diagnosed(asked.diagnosed),
            "As `rig campaigns --diagnose` does it: every equation, pages kept.",
        ),
    ]
    text = to_page(
        [
            "An archive of campaigns",
            f"Every campaign is of one simulated rig and has {asked.runs} runs of 20 s. The"
            f" equation `{MODEL}` is fitted on each, as `rig campaigns --refit {MODEL}` does it.",
        ],
        tables,
        Provenance.now(0),
    )
    if asked.out is None:
        sys.stdout.write(text)
    else:
        write_text_atomic(asked.out, text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
