"""The access log: which runs a diagnosis has used, so that a second use is marked.

A test run confirms once. A run that any earlier diagnosis held, to train or to test, has been used:
a finding confirmed on it later is exploratory. Runs are identified by the hash of their samples, so
a copy, another name or another folder does not make them new.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from estimation.diagnosis.split import Sealed, samples_hash
from estimation.file_kinds import LEDGER
from estimation.files import OutputError, check_output
from estimation.recording import Recording
from rig.configuration.folders import state_folder
from rig.errors import DataError

Look = Mapping[str, Any]
"""One use of runs, a line of the ledger."""


class LedgerError(DataError):
    """The ledger cannot be read or written."""


def default_ledger() -> Path:
    """Return the access log, in the state folder."""
    return state_folder() / "looks.jsonl"


def look_at(recordings: Sequence[Recording], sealed: Sealed) -> Look:
    """Describe a use of runs, as the ledger holds it."""
    return {
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "data_hash": sealed.data_hash,
        "seal": sealed.seal,
        "seed": sealed.seed,
        "discover": sealed.discover,
        "confirm": sealed.confirm,
        "runs": {r.name: samples_hash(r) for r in recordings},
    }


@dataclass(frozen=True)
class Ledger:
    """The uses so far, one line of JSON each in a file that the first one makes."""

    path: Path

    def known(self, recordings: Sequence[Recording]) -> frozenset[str]:
        """Return the names of the runs that any earlier diagnosis used, under whatever name.

        Raises:
            LedgerError: The ledger cannot be read.
        """
        try:
            looks = [
                json.loads(line)["runs"].values()
                for line in self._text().splitlines()
                if line.strip()
            ]
        except (OSError, ValueError, KeyError, AttributeError) as error:
            raise LedgerError(
                f"The ledger of diagnoses {self.path} cannot be read.",
                str(error),
                "Move it away; every use in it will then count as the first one.",
            ) from error
        used = {run for look in looks for run in look}
        return frozenset(r.name for r in recordings if samples_hash(r) in used)

    def check(self) -> None:
        """Refuse a log that could not be written, before the work of a diagnosis.

        Raises:
            LedgerError: It cannot be written.
        """
        try:
            check_output(self.path, LEDGER)
        except OutputError as error:
            raise self._unwritable(error) from error

    def enter(self, look: Look) -> None:
        """Enter a use that `look_at` described, before its result is shown.

        Raises:
            LedgerError: The ledger cannot be read or written.
        """
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with self.path.open("a", encoding="utf-8") as file:  # two diagnoses may end at once
                file.write(json.dumps(look) + "\n")
        except OSError as error:
            raise self._unwritable(error) from error

    def _text(self) -> str:
        return self.path.read_text(encoding="utf-8") if self.path.exists() else ""

    def _unwritable(self, error: Exception) -> LedgerError:
        return LedgerError(
            f"The ledger of diagnoses {self.path} cannot be written.",
            f"{error} Without it a second use of the same runs would pass as the first.",
            "Name another place with --ledger or RIG_STATE_DIR.",
        )
