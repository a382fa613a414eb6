"""Every command that a page states is one that the present program takes, with its options.

Those that need no rig, no data and seconds only are run, on the simulated rig.
"""

import re
import shlex
from functools import cache
from itertools import pairwise
from pathlib import Path

import click
import pytest
import typer

from benchmarks import results
from estimation.model_file import names
from rig.cli.main import app

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
PAGES += sorted((ROOT / "docs/results").glob("*.md"))
PAGES += [*sorted((ROOT / "drivers").glob("*/README.md")), ROOT / "firmware/README.md"]

SPAN = re.compile(r"`([^`\n]+)`")
FENCE = re.compile(r"^```\w*\n(.*?)^```", re.MULTILINE | re.DOTALL)
PLACES = "[|;&#]"
"""A command ends where the shell goes on with another."""


def stated(page: Path) -> list[str]:
    """Return the `rig` commands of a page, as typed."""
    text = page.read_text(encoding="utf-8")
    lines = [line for block in FENCE.findall(text) for line in block.splitlines()]
    lines += SPAN.findall(FENCE.sub("", text))
    found = []
    for line in lines:
        typed = line.strip().removeprefix("$ ").removeprefix(".venv/bin/")
        if re.match(r"rig [a-z]", typed) and "..." not in typed:
            found.append(re.split(rf"\s{PLACES}", typed)[0])
    return found


COMMANDS = sorted(
    {command for page in PAGES for command in stated(page)}
    | {made.command for made in results.PAGES if made.command.startswith("rig ")}
)


@cache
def tree() -> click.Command:
    """Return the program with all its commands, made once: it takes as long as a test."""
    return typer.main.get_command(app)


def resolved(words: list[str]) -> tuple[click.Command, list[str]]:
    """Return the command that words name, and the words after it."""
    command = tree()
    while words and hasattr(command, "commands"):
        if words[0].startswith("-"):
            break
        assert words[0] in command.commands, f"rig has no {words[0]}"
        command = command.commands[words.pop(0)]
    return command, words


def test_pages_state_commands():
    assert len(COMMANDS) > 60


@pytest.mark.parametrize("typed", COMMANDS)
def test_a_stated_command_exists_with_its_options(typed):
    words = shlex.split(typed)[1:]
    command, rest = resolved(words)
    known = {name for parameter in command.params for name in parameter.opts}
    known |= {name for parameter in command.params for name in parameter.secondary_opts}
    known |= {"-h", "--help", "--install-completion", "--show-completion"}
    given = {word.split("=")[0] for word in rest if re.match(r"--?[a-z]", word)}
    assert given <= known, f"{typed}: no option {', '.join(given - known)}"
    for option, value in pairwise(rest):
        if command.name == "fit" and option in ("-m", "--model") and re.fullmatch("[a-z]+", value):
            assert value in (*names(), "states", "network"), f"{typed}: no model {value}"


RUN = [
    "rig effects",
    "rig effects ripple.motor",
    "rig config list",
    "rig config check --sim",
    "rig config show --sim",
    "rig devices",
    "rig doctor --sim",
    "rig selftest --sim",
    "rig udev",
    "rig calibrate list",
    "rig grasper designs",
    "rig record --sim --protocol quick -o logs/first",
    "rig log check logs/first",
    "rig log info logs/first",
    "rig campaigns",
    "rig campaigns maryland 'frequency_hz>=0.1'",
    "rig log export logs/first --format csv",
]
"""A first session, in order: each command goes on from what the ones before made."""


@pytest.mark.integration
def test_a_first_session_of_stated_commands_runs(newcomer, said):
    for typed in RUN:
        said(typed.removeprefix("rig "))
