"""A terminal that goes away, with its window or its connection, leaves the rig safe."""

import os
import pty
import sys
from collections.abc import Callable
from pathlib import Path

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


def typed(words: list[str], until: Callable[[str], bool]) -> int:
    """Type a command in a terminal of its own, close that terminal; return the exit code."""
    child, terminal = pty.fork()
    if child == 0:
        os.execv(sys.executable, [sys.executable, "-m", "rig", *words])  # noqa: S606
    shown = ""
    while not until(shown):
        shown += os.read(terminal, 4096).decode(errors="replace")
    os.close(terminal)
    _, status = os.waitpid(child, 0)
    return os.waitstatus_to_exitcode(status)


def test_recording_closes_its_log_and_the_rig_is_safe(tmp_path: Path) -> None:
    (tmp_path / "long.toml").write_text(PROTOCOL)
    out = tmp_path / "campaign"
    words = ["record", "-p", str(tmp_path / "long.toml"), "-o", str(out)]
    assert typed(words, lambda _: bool(list(out.glob("*.part")))) == 130
    (path,) = out.glob("*.mcap*")
    end = read_log(path).end
    assert end is not None
    assert not end.clean


@pytest.mark.parametrize("words", [["live", "--pace", "1"], ["live", "--plain"]])
def test_the_display_ends_as_ctrl_c_ends_it(words: list[str]) -> None:
    assert typed(words, lambda shown: "mN" in shown) == 130
