"""Run the command line as `python -m rig`, and as the console script.

A Ctrl-C while modules are still being loaded ends the program at once: nothing is open then. An
exception would be shown with its traceback, or be taken by a module that tries an import.
"""

import os
import signal
from types import FrameType

INTERRUPTED = 130


def _end(number: int, frame: FrameType | None) -> None:
    os.write(2, b"Interrupted.\n")
    os._exit(INTERRUPTED)


def run() -> None:
    """Load the command line and run it."""
    is_heard = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if is_heard:
        signal.signal(signal.SIGINT, _end)
    from rig.cli.main import run as run_commands

    if is_heard:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    run_commands()


if __name__ == "__main__":
    run()
