"""The rig's commands where the modules and signals of Unix are missing, as on Windows."""

import subprocess
import sys

import pytest

WITHOUT_UNIX = """
import os, signal, sys
import serial  # its own module differs by system
for name in ("fcntl", "termios", "pty", "tty", "resource", "pwd", "grp"):
    sys.modules[name] = None
for name in ("SIGHUP", "SIGALRM", "SIGQUIT", "SIGUSR1", "SIGUSR2", "SIGKILL", "SIGCONT", "SIGTSTP"):
    delattr(signal, name)
for name in ("fork", "getuid", "geteuid", "killpg", "setsid", "openpty", "mkfifo"):
    delattr(os, name)
from rig.cli.main import main
for words in sys.argv[1:]:
    assert main(words.split()) == 0, words
"""


@pytest.mark.integration
def test_recording_and_reading_need_nothing_of_unix(tmp_path):
    commands = (
        "record --sim --protocol still --out runs",
        "log check runs",
        "view runs --out runs.html",
        "stop --sim",
    )
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_UNIX, *commands],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "runs.html").exists()
