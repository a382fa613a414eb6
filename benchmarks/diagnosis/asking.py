"""Asking a `rig` executable, of this checkout or another, for a diagnosis."""

import json
import os
import resource
import subprocess
import tempfile
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from estimation.files import write_text_atomic
from rig.output.provenance import commit

TIME_LIMIT_S = 3600.0
ONE_CORE = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"
)
"""Processor time is compared between versions; threads that wait for others would add to it."""


@dataclass(frozen=True)
class Answer:
    """What came of one call.

    Attributes:
        report: The JSON answer, or None when there was none.
        message: Why there was none.
        protocol: Text of the proposed protocol, or None.
    """

    report: dict[str, Any] | None
    message: str
    protocol: str | None
    cpu_s: float
    wall_s: float

    def save(self, path: Path) -> None:
        """Write the answer; a reader never sees half of it."""
        write_text_atomic(path, json.dumps(asdict(self)))

    @classmethod
    def load(cls, path: Path) -> "Answer":
        """Read what `save` wrote."""
        return cls(**json.loads(path.read_text()))


@dataclass(frozen=True)
class Rig:
    """A `rig` executable.

    Attributes:
        path: The executable; its own checkout is the version that is measured.
        name: What the version is called; its commit when empty.
    """

    path: Path
    name: str = ""

    @cached_property
    def version(self) -> str:
        """Name, or the commit of the checkout in whose `.venv/bin` the executable lies."""
        return self.name or commit(self.path.absolute().parents[2])

    @cached_property
    def _help(self) -> str:
        """The words of `rig diagnose --help`, wide enough that no option is cut."""
        done = subprocess.run(  # noqa: S603 - the executable that the caller named
            [str(self.path), "diagnose", "--help"],
            capture_output=True,
            text=True,
            check=True,
            env=_environment({"COLUMNS": "200", "TERM": "dumb"}),
        )
        return done.stdout

    def has(self, option: str) -> bool:
        """Return whether `rig diagnose` has an option."""
        return option in self._help.split()

    def diagnose(self, folder: Path, options: Sequence[str] = ()) -> Answer:
        """Ask for a diagnosis of a folder of recordings, by further words of the command line."""
        to_file = "--json-out" if self.has("--json-out") else "--json"
        with tempfile.TemporaryDirectory(prefix="rig-measure-") as own:
            out, protocol = Path(own, "answer.json"), Path(own, "next.toml")
            words = [str(self.path), "diagnose", str(folder), *options, to_file, str(out)]
            words += ["--protocol-out", str(protocol)] if self.has("--protocol-out") else []
            began, used = time.perf_counter(), _children_s()
            message = _run(words, {"RIG_STATE_DIR": own})  # no diagnosis has seen these runs before
            return Answer(
                json.loads(out.read_text()) if out.exists() else None,
                "" if out.exists() else message,
                protocol.read_text() if protocol.exists() else None,
                round(_children_s() - used, 2),
                round(time.perf_counter() - began, 2),
            )


def _run(words: Sequence[str], more: dict[str, str]) -> str:
    """Run a command and return the end of what it wrote."""
    try:
        done = subprocess.run(  # noqa: S603 - the executable that the caller named
            words,
            capture_output=True,
            text=True,
            check=False,
            timeout=TIME_LIMIT_S,
            env=_environment(more),
        )
    except subprocess.TimeoutExpired:
        return f"no answer within {TIME_LIMIT_S:g} s"
    said = (done.stderr or done.stdout).strip()
    return f"exit code {done.returncode}: {said[max(said.rfind('error:'), 0) :][:500]}"


def _environment(more: dict[str, str]) -> dict[str, str]:
    """Return the environment of a call: another checkout must not import this one's modules."""
    return {k: v for k, v in os.environ.items() if k != "PYTHONPATH"} | ONE_CORE | more


def _children_s() -> float:
    """Return the processor time of all calls that ended, s."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
