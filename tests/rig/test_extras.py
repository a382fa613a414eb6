"""A command that needs an extra reports which, and how it is installed here."""

import ast
import builtins
import sys
import tomllib
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest

from estimation.recording import Recording
from rig.cli import extras
from rig.cli.main import main
from rig.log.convert import write_recording

ROOT = Path(__file__).resolve().parents[2]
EXTRAS = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]


@pytest.fixture
def without_pyarrow(monkeypatch):
    def refuse(name, *rest, real=builtins.__import__, **named):
        if name.partition(".")[0] == "pyarrow":
            raise ModuleNotFoundError("No module named 'pyarrow'", name="pyarrow")
        return real(name, *rest, **named)

    monkeypatch.setattr(builtins, "__import__", refuse)


@pytest.fixture
def words(tmp_path):
    recording = Recording("a", np.arange(3) * 1e-3, {"motor_current_a": np.ones(3)})
    log = write_recording(tmp_path / "a.mcap", recording)
    return ["log", "export", str(log), "--format", "parquet"]


def test_the_error_holds_the_command_to_type(words, without_pyarrow, capsys):
    assert main(words) == 2
    said = capsys.readouterr().err
    assert "Parquet needs pyarrow, which is not installed." in said
    assert f"-m pip install -e '{extras._short(ROOT)}[parquet]'" in said


@pytest.mark.parametrize(("answer", "installed"), [("y\n", True), ("n\n", False), ("\n", False)])
def test_on_a_terminal_it_prompts_before_it_installs(
    words, without_pyarrow, capsys, monkeypatch, answer, installed
):
    ran = []

    def run(command, check):
        ran.append(command)
        return type("Done", (), {"returncode": 0})

    monkeypatch.setattr(extras.subprocess, "run", run)
    monkeypatch.setattr(extras.typer, "confirm", lambda *_, **__: answer == "y\n")
    for stream in (sys.stdin, sys.stderr):
        monkeypatch.setattr(stream, "isatty", lambda: True)
    assert main(words) == 2
    assert ran == ([extras.install_command("parquet")] if installed else [])
    assert ("Type the command again" in capsys.readouterr().err) == installed


def test_outside_a_checkout_the_extra_is_installed_by_what_it_holds(tmp_path, monkeypatch):
    listed = ["numpy>=2.2", "torch==2.13.0; extra == 'learn'", "pin>=4.1 ; extra == 'arm'"]
    monkeypatch.setattr(metadata, "requires", lambda name: listed)
    assert extras.install_command("learn", tmp_path)[-2:] == ["install", "torch==2.13.0"]


def test_every_extra_that_an_error_names_is_in_the_project():
    named = set()
    for room in ("rig", "drivers", "estimation", "calibration"):
        for path in (ROOT / room).rglob("*.py"):
            named |= _extras_in(path)
    assert named
    assert named <= set(EXTRAS)


def _extras_in(path):
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "MissingExtraError":
            last = node.args[-1]
            assert isinstance(last, ast.Constant), path
            found.add(last.value)
    return found
