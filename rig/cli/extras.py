"""Extras of the project that are not installed: the command that installs one, and an offer to."""

import re
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import typer

import rig

CHECKOUT = Path(rig.__file__).resolve().parents[1]
"""Root of the checkout where the package runs from one."""


def install_command(extra: str, checkout: Path = CHECKOUT) -> list[str]:
    """Return the words of the command that installs an extra for this interpreter.

    From a checkout it names the checkout. Elsewhere it names what the extra holds: the project is
    in no package index, and the index's package of the same name is somebody else's.
    """
    pip = [_short(Path(sys.executable)), "-m", "pip", "install"]
    if (checkout / "pyproject.toml").is_file():
        return [*pip, "-e", f"{_short(checkout)}[{extra}]"]
    marker = re.compile(rf"""\s*;.*\bextra\s*==\s*['"]{re.escape(extra)}['"].*""")
    needed = (line for line in metadata.requires("rig") or () if marker.search(line))
    return [*pip, *(marker.sub("", line) for line in needed)]


def offer(extra: str) -> bool:
    """Whether a person at a terminal had an extra installed; never asked elsewhere."""
    if not (sys.stdin.isatty() and sys.stderr.isatty()):
        return False
    if not typer.confirm("Install it now?", default=False, err=True):
        return False
    return subprocess.run(install_command(extra), check=False).returncode == 0  # noqa: S603


def _short(path: Path) -> str:
    """Return a path as seen from the working folder, where it lies below it."""
    here = Path.cwd()
    if path == here:
        return "."
    return str(path.relative_to(here)) if path.is_relative_to(here) else str(path)
