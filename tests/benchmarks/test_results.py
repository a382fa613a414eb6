"""The pages of results: each states its source and has a command, and prose quotes them rightly."""

import importlib.util
import re
import subprocess
from pathlib import Path

import pytest

from benchmarks.results import FOLDERS, PAGES

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "docs/results"

LINK = re.compile(r"\((?:docs/)?results/([a-z0-9-]+)\.md\)")
SENTENCE_ENDS = re.compile(r"(?<=[.:])\s+(?=\W*[A-Z])|\n\s*\n|\n(?=[|-])")
FIGURE = re.compile(r"(?<![\w.])\d+(?:,\d{3})*\.\d+\b|\b\d+(?:,\d{3})+\b")
"""A decimal fraction or a number of thousands: what prose quotes from a table."""


def test_every_page_has_a_row_and_every_row_a_page():
    assert sorted(page.name for page in PAGES) == sorted(p.stem for p in FOLDER.glob("*.md"))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_a_page_states_its_source_and_its_command_exists(page):
    text = (FOLDER / f"{page.name}.md").read_text(encoding="utf-8")
    assert "never" not in page.made()
    assert re.search(r"\bseeds?\b", text)
    program, *words = page.words(dict.fromkeys(FOLDERS, "FOLDER"))
    assert Path(program).name == "rig" or importlib.util.find_spec(words[1]) is not None
    for path in page.code.split():
        listed = subprocess.run(["git", "ls-files", path], cwd=ROOT, capture_output=True, text=True)
        assert listed.stdout, f"there is no {path}"


def test_figures_quoted_with_a_link_are_on_the_page_linked():
    faults, checked = [], 0
    for path in [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]:
        for sentence in SENTENCE_ENDS.split(path.read_text(encoding="utf-8")):
            pages = [FOLDER / f"{name}.md" for name in LINK.findall(sentence)]
            text = "\n".join(page.read_text(encoding="utf-8").replace(",", "") for page in pages)
            for figure in FIGURE.findall(LINK.sub("", sentence)) if pages else []:
                checked += 1
                if not re.search(rf"(?<![\d.]){re.escape(figure.replace(',', ''))}(?!\d)", text):
                    faults.append(f"{path.name}: {figure} is not on {', '.join(map(str, pages))}")
    assert checked
    assert not faults, "\n".join(faults)
