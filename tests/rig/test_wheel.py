"""The wheel builds, installs into an environment of its own, and works there."""

import os
import subprocess
import sys
import sysconfig
import venv
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

pytestmark = pytest.mark.long


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


def run(place: Path, folder: Path, *words: str) -> str:
    environment = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "RIG_CONFIG")}
    command = [place / "bin" / words[0], *words[1:]]
    done = subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_library_is_the_installed_one(installed, tmp_path):
    code = "import rig, rig.library, estimation; print(rig.__file__, estimation.__file__)"
    said = run(installed, tmp_path, "python", "-c", code)
    assert said.count(str(installed)) == 2
    # the files that are no modules came with it
    code = "import rig; print(len(rig.declared('motor')), len(rig.declared(machine='emps')))"
    assert run(installed, tmp_path, "python", "-c", code).split() == ["1", "1"]


def test_the_demo_runs_from_the_wheel(installed, tmp_path):
    run(installed, tmp_path, "rig", "demo", "--seed", "1", "--out", "demo")
    assert [*(tmp_path / "demo").rglob("diagnosis.html")]
