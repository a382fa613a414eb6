"""A terminal that goes away, with its window or its connection, leaves the rig safe."""

import os
import pty
import sys
from collections.abc import Callable

import pytest

from rig.log.reader import read_log
from tests.rig.simulated import protocol_file

pytestmark = [pytest.mark.integration, pytest.mark.usefixtures("hang_up_is_heard")]


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
    out = tmp_path / "campaign"
    protocol = protocol_file(tmp_path, duration_s=2000.0)
    command = Typed("record", "-p", str(protocol), "-o", str(out))
    assert command.close_terminal(lambda _: bool(list(out.glob("*.part")))) == 130
    (path,) = out.glob("*.mcap*")
    assert not read_log(path).end.clean


def test_the_display_ends_as_ctrl_c_ends_it():
    displays = Typed("live", "--pace", "1"), Typed("live", "--plain")
    assert [one.close_terminal(lambda shown: "mN" in shown) for one in displays] == [130, 130]
