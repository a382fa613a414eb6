"""Where a result comes from: the day, the commit, the seed and the command that made it."""

import re
import shutil
import subprocess
import sys
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import rig


def now_utc() -> str:
    """Return the time now, UTC, ISO 8601 to the second."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def utc_of(since_epoch_ns: int | None) -> str:
    """Return a time in ns since the Unix epoch as `now_utc` has it; empty where it is unknown."""
    from estimation.recording import UNDATED_NS

    if since_epoch_ns is None or since_epoch_ns < UNDATED_NS:
        return ""
    return datetime.fromtimestamp(since_epoch_ns * 1e-9, UTC).isoformat(timespec="seconds")


@dataclass(frozen=True)
class Provenance:
    """Data needed to reproduce a result."""

    date: str  # day and time, UTC, ISO 8601 to the minute
    commit: str  # as `commit` returns it
    version: str
    seed: int  # seed of everything random
    # command line; of an absolute path only the last part, since the others are the machine's own
    command: str

    @classmethod
    def now(cls, seed: int) -> "Provenance":
        """Return the provenance of what this process makes now."""
        words = [re.sub(r"(^|=)[~/]\S*/", r"\1", word) for word in sys.argv]
        if module := getattr(sys.modules["__main__"], "__spec__", None):
            words[:1] = ["python", "-m", module.name.removesuffix(".__main__")]
        return cls(
            date=datetime.now(UTC).strftime("%Y-%m-%dT%H:%MZ"),
            commit=commit(Path(rig.__file__).parents[1]),
            version=rig.__version__,
            seed=seed,
            command=" ".join(words),
        )

    def line(self) -> str:
        """Return it as one line of text."""
        return (
            f"Made {self.date} by `{self.command}`, rig {self.version}, commit {self.commit}, "
            f"seed {self.seed}."
        )


def commit(tree: Path) -> str:
    """Return the short commit of a source tree, or `unknown` when it is not a git tree.

    It ends in `+changes` when files outside `docs` differ from it. Those in `docs` do not count:
    pages made one after the other are of one commit.
    """
    git = shutil.which("git")
    if git is None or not (tree / ".git").exists():
        return "unknown"

    def ask(*words: str) -> str | None:
        answer = subprocess.run(  # noqa: S603 - git itself, with fixed words
            [git, "-C", str(tree), *words], capture_output=True, text=True, check=False, timeout=20
        )
        return answer.stdout.strip() if answer.returncode == 0 else None

    head = ask("rev-parse", "--short", "HEAD")
    if head is None:
        return "unknown"
    changes = ask("status", "--porcelain", "--untracked-files=no", "--", ":/", ":/!docs")
    return head + ("+changes" if changes else "")
