"""The documentation site builds without a warning, and its commands exist."""

import re
from pathlib import Path

import pytest

from rig.cli.main import app

pytestmark = pytest.mark.integration

ROOT = Path(__file__).parents[2]


@pytest.mark.filterwarnings("default")
def test_the_site_builds_strictly(tmp_path):
    pytest.importorskip("mkdocs")
    pytest.importorskip("mkdocstrings")
    from mkdocs.commands.build import build
    from mkdocs.config import load_config

    config = load_config(str(ROOT / "mkdocs.yml"), site_dir=str(tmp_path), strict=True)
    build(config)
    assert "Troubleshooting" in (tmp_path / "index.html").read_text()
    assert "FsrMemory" in (tmp_path / "reference" / "calibration.html").read_text()
    for page, word in (
        ("effects", "ripple.motor"),
        ("configuration", "watchdog_s"),
        ("protocols", "loads_a"),
    ):
        assert word in (tmp_path / f"{page}.html").read_text()
    loaded = r"<(?:script[^>]+src|link[^>]+href)=\"https?://"
    pages = [page.read_text() for page in tmp_path.rglob("*.html")]
    assert not [page for page in pages if re.search(loaded, page)]


def test_every_command_in_the_pages_exists():
    from typer.main import get_command

    root = get_command(app)
    pages = ("index", "how-to", "troubleshooting", "calibration", "foxglove", "diagnose")
    for page in ("README.md", *(f"docs/{name}.md" for name in pages)):
        text = (ROOT / page).read_text()
        spoken = re.findall(r"`(?:\.venv/bin/)?rig ([a-z][^`]*)`", text)
        blocks = re.findall(r"^ {4,}(?:\.venv/bin/)?rig ([a-z].*)$", text, re.MULTILINE)
        for words in [*spoken, *blocks]:
            command = root
            for word in words.split():
                below = getattr(command, "commands", None)
                if below is None:
                    break
                assert word in below, f"{page}: rig {words}"
                command = below[word]
            options = {name for p in command.params for name in p.opts}
            for option in re.findall(r"(?<=\s)--[a-z-]+", words):
                assert option in options, f"{page}: rig {words}"
