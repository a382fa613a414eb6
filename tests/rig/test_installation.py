"""Installation: extras are named where needed, nothing needs Unix modules, the wheel works."""

import ast
import os
import subprocess
import sys
import sysconfig
import tomllib
import venv
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
    monkeypatch.setitem(sys.modules, "pyarrow", None)


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


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of an environment with the wheel; dependencies come from this one."""
    folder = tmp_path_factory.mktemp("wheel")
    build = [sys.executable, "-m", "pip", "wheel", "--no-deps", "--quiet", "-w", str(folder)]
    subprocess.run([*build, str(ROOT)], check=True)
    (wheel,) = folder.glob("rig-*.whl")
    place = folder / "env"
    venv.create(place, with_pip=True)
    python = place / "bin" / "python"
    install = [python, "-m", "pip", "install", "--no-deps", "--quiet", str(wheel)]
    subprocess.run(install, check=True)
    paths = {sysconfig.get_path("purelib"), *(p for p in sys.path if p.endswith("-packages"))}
    site = next((place / "lib").glob("python*/site-packages"))
    (site / "dependencies.pth").write_text("\n".join(sorted(paths)) + "\n")
    return place


def run_there(place: Path, folder: Path, *words: str) -> str:
    environment = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "RIG_CONFIG")}
    command = [place / "bin" / words[0], *words[1:]]
    done = subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.long
def test_the_library_is_the_installed_one(installed, tmp_path):
    code = "import rig, rig.library, estimation; print(rig.__file__, estimation.__file__)"
    said = run_there(installed, tmp_path, "python", "-c", code)
    assert said.count(str(installed)) == 2
    # the files that are no modules came with it
    code = "import rig; print(len(rig.declared('motor')), len(rig.declared(machine='emps')))"
    assert run_there(installed, tmp_path, "python", "-c", code).split() == ["1", "1"]


@pytest.mark.long
def test_the_demo_runs_from_the_wheel(installed, tmp_path):
    run_there(installed, tmp_path, "rig", "demo", "--seed", "1", "--out", "demo")
    assert [*(tmp_path / "demo").rglob("diagnosis.html")]
