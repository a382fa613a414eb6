"""A trip of the logic in this computer, kept until somebody clears it.

A board keeps its trip while it has its supply. This logic ends with its process; without a file the
next session would arm as if nothing had happened.
"""

import hashlib
import json
from pathlib import Path

from estimation.files import write_text_atomic
from rig.configuration.folders import state_folder


class TripLatch:
    """The trip of the rig at a URL, in a file of a folder; the user's own folder if None."""

    def __init__(self, url: str, folder: Path | None = None) -> None:
        digest = hashlib.sha256(url.encode()).hexdigest()[:16]
        self._path = (folder or state_folder()) / f"tripped-{digest}.json"
        self._url = url

    @property
    def code(self) -> int:
        """Code of the trip that nobody has cleared, 0 for none; one that cannot be read is 1."""
        try:
            return int(json.loads(self._path.read_text())["code"])
        except FileNotFoundError:
            return 0
        except (OSError, ValueError, KeyError, TypeError):
            return 1  # something was written here: better a trip too many

    def keep(self, code: int) -> None:
        """Keep a trip; 0 forgets it."""
        if code == 0:
            self._path.unlink(missing_ok=True)
            return
        self._path.parent.mkdir(parents=True, exist_ok=True)
        write_text_atomic(self._path, json.dumps({"url": self._url, "code": code}) + "\n")
