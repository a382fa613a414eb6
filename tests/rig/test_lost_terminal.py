"""A terminal that goes away, with its window or its connection, leaves the rig safe."""

import os
import pty
import sys
from collections.abc import Callable

import pytest

from rig.log.reader import read_log

pytestmark = [pytest.mark.integration, pytest.mark.usefixtures("hang_up_is_heard")]

PROTOCOL = """
name = "long"
[[runs]]
kind = "sine"
frequencies_hz = [0.1]
loads_a = [0.1]
duration_s = 2000.0
"""


class Typed:
    """A command that was typed in a terminal of its own."""

    def __init__(self, *words: str) -> None:
        self._child, self._terminal = pty.fork()
        if self._child == 0:
            os.execv(sys.executable, [sys.executable, "-m", "rig", *words])  # noqa: S606
        os.set_inheritable(self._terminal, False)  # a later command would keep it open

    def close_terminal(self, when: Callable[[str], bool]) -> int:
        """Close the terminal when it shows something; return the command's exit code."""
        shown = ""
        while not when(shown):
            shown += os.read(self._terminal, 4096).decode(errors="replace")
        os.close(self._terminal)
        _, status = os.waitpid(self._child, 0)
        return os.waitstatus_to_exitcode(status)


def test_recording_closes_its_log_and_the_rig_is_safe(tmp_path):
    (tmp_path / "long.toml").write_text(PROTOCOL)
    out = tmp_path / "campaign"
    command = Typed("record", "-p", str(tmp_path / "long.toml"), "-o", str(out))
    assert command.close_terminal(lambda _: bool(list(out.glob("*.part")))) == 130
    (path,) = out.glob("*.mcap*")
    end = read_log(path).end
    assert not end.clean


def test_the_display_ends_as_ctrl_c_ends_it():
    displays = Typed("live", "--pace", "1"), Typed("live", "--plain")
    assert [one.close_terminal(lambda shown: "mN" in shown) for one in displays] == [130, 130]
