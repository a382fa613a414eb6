"""Machines that other people built: their published recordings, handed over to `rig diagnose`.

One module a machine reads the authors' own files and hands them over as MATLAB files with channels
named by unit, and a declared model with it: what a person who knows nothing of this project's
inside would do today. No recording is part of this project; the folder of them is given by path.
"""

import sys
from collections.abc import Iterator
from pathlib import Path

from benchmarks.diagnosis.case import Case
from benchmarks.diagnosis.machines import emps, smart_grasper, sts3215, ur10e

MACHINES = {
    "emps": emps.cases,
    "smart-grasper": smart_grasper.cases,
    "sts3215": sts3215.cases,
    "ur10e": ur10e.cases,
}
"""Folder of each machine's recordings, and what makes cases of it."""


def cases(path: Path) -> Iterator[Case]:
    """Yield the cases of every machine whose folder is there; the others are named on stderr."""
    for name, of in MACHINES.items():
        if (path / name).is_dir():
            yield from of(path / name)
        else:
            sys.stderr.write(f"{name} skipped: there is no folder {path / name}\n")
