"""A program that holds a rig's spindle still for minutes and tells when it has begun.

Its words are a configuration, what of it to change, as JSON, and the current of the load, A.
"""

import json
import sys
from pathlib import Path

import numpy as np

from rig.bench.logger import open_logger
from rig.bench.session import Session
from rig.configuration.config import load_config


def playing(config: Path | str, load_a: float = 0.1, **changes: object) -> list[str]:
    """Return the words that start it."""
    return [sys.executable, __file__, str(config), json.dumps(changes), str(load_a)]


if __name__ == "__main__":
    settings = load_config(Path(sys.argv[1])).changed(**json.loads(sys.argv[2]))
    link = open_logger(settings)
    with Session(settings, link) as session:
        for reading in session.play(np.full(600_000, -1.04), np.full(600_000, float(sys.argv[3]))):
            if reading.setpoint.max() > 0:
                process = getattr(link, "process", None)
                sys.stdout.write("playing\n" if process is None else f"{process.pid}\n")
                sys.stdout.flush()
