"""Every result page states a command that the present program takes."""

import shlex
from pathlib import Path

import pytest
import typer

from rig.cli.main import app

PAGES = sorted((Path(__file__).parents[2] / "docs/results").glob("*.md"))


def stated(page: Path) -> list[str]:
    """Return the command in a page's last line of provenance, empty where it has none."""
    made = [line for line in page.read_text().splitlines() if line.startswith("Made ")]
    return shlex.split(made[-1].split("`")[1]) if made else []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_pages_command_exists_with_its_options(page):
    words = stated(page)
    if not words:
        pytest.skip(f"{page.name} states no command")
    if words[0] == "python":
        assert words[1] == "-m"
        return
    assert words.pop(0) == "rig"
    command = typer.main.get_command(app)
    while words and not words[0].startswith("-") and hasattr(command, "commands"):
        assert words[0] in command.commands, f"rig has no {words[0]}"
        command = command.commands[words.pop(0)]
    known = {name for parameter in command.params for name in parameter.opts}
    assert {word for word in words if word.startswith("--")} <= known
