"""The documentation site builds without a warning."""

import re
from pathlib import Path

import pytest

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
