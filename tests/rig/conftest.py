"""Commands as a person types them, and the firmware as a process of its own."""

import json
import shlex
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from rig.cli.main import main
from rig.configuration.config import SHIPPED
from rig.simulation.firmware_process import PROGRAM


@pytest.fixture
def said(capsys: pytest.CaptureFixture[str]) -> Callable[..., Any]:
    """Run a command, hold its exit code against `code`, and return what it printed.

    Texts are split as a shell splits them, paths are not.
    """

    def run(*words: str | Path, code: int = 0) -> Any:
        capsys.readouterr()
        typed = [[str(w)] if isinstance(w, Path) else shlex.split(w) for w in words]
        found = main([word for part in typed for word in part])
        printed = capsys.readouterr()
        assert found == code, printed.err
        return printed

    return run


@pytest.fixture
def answered(said: Callable[..., Any]) -> Callable[..., Any]:
    """Run a command with `--json`, as `said`, and return what it printed as JSON."""
    return lambda *words, code=0: json.loads(said(*words, "--json", code=code).out)


@pytest.fixture
def newcomer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The empty working folder of a person with no rig, no calibration and no cache."""
    for name in ("RIG_CONFIG", "RIG_CALIBRATIONS"):
        monkeypatch.delenv(name, raising=False)
    for name in ("XDG_CONFIG_HOME", "XDG_CACHE_HOME"):
        monkeypatch.setenv(name, str(tmp_path / name))
    (tmp_path / "work").mkdir()
    monkeypatch.chdir(tmp_path / "work")
    return tmp_path / "work"


@pytest.fixture
def program(library: Path) -> Path:
    if not PROGRAM.is_file():
        pytest.skip("the firmware process is built on Linux only")
    return PROGRAM


@pytest.fixture
def port(program: Path) -> Iterator[str]:
    """The port of a board: the firmware's process, which ends with the test."""
    with subprocess.Popen([str(program)], stdout=subprocess.PIPE, text=True) as process:
        yield process.stdout.readline().strip()
        process.kill()


@pytest.fixture
def board(port: str, tmp_path: Path) -> Path:
    """The configuration of a rig that has this board."""
    path = tmp_path / "board.toml"
    path.write_text((SHIPPED / "pty.toml").read_text().replace("sim://pty", port))
    return path
