"""Pages of HTML: well formed, without references to anything outside, and quiet in a browser."""

import re
import subprocess
from html.parser import HTMLParser
from io import StringIO
from pathlib import Path

import numpy as np
import pytest

from estimation.diagnosis.result import Value
from estimation.effects import catalogue
from estimation.fitting import fit
from estimation.model_file import read
from estimation.residual import largest_structure
from rig.output import figures
from rig.output.provenance import Provenance, commit
from rig.output.render import write_report
from rig.output.table import TextTable, to_markdown, to_rich
from rig.reports.diagnosis_words import meaning, sizes_of
from rig.reports.first_look import first_look
from tests.estimation.synthetic import campaign
from tests.rig.browser import chromium

pytestmark = pytest.mark.integration

VOID = {"meta", "br", "hr", "img", "link", "input"}


class Page(HTMLParser):
    """Reads a page and keeps what a test asks for."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.ids: list[str] = []
        self.references: list[str] = []
        self.counts: dict[str, int] = {}
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.counts[tag] = self.counts.get(tag, 0) + 1
        for name, value in attrs:
            if name == "id":
                self.ids.append(value)
            if name in ("src", "href", "xlink:href", "data", "action", "srcset"):
                self.references.append(value)
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag):
        assert self.open, f"</{tag}> closes nothing"
        assert self.open.pop() == tag


@pytest.fixture(scope="module")
def pages() -> dict[str, str]:
    runs = campaign(lambda angle, speed, load: 2e-3 * np.sin(7 * angle))
    model = fit(read(Path("motor")), runs)
    return {
        "first_look": first_look(
            model, runs, largest_structure(model, runs), "Made of a <b> & c.", Provenance.now(1)
        ),
    }


def test_a_page_is_well_formed_and_complete(pages):
    found = Page(pages["first_look"])
    assert found.open == []
    assert found.counts["svg"] == found.counts["figure"] == 3
    assert found.counts["table"] == 2
    assert len(found.ids) == len(set(found.ids))
    assert "seed" in pages["first_look"]


def test_a_page_refers_to_nothing_outside_itself(pages):
    found = Page(pages["first_look"])
    assert not re.search(r"https?:|//\w|@import|\bsrc=", pages["first_look"])
    assert "script" not in found.counts
    assert all(reference.startswith("#") for reference in found.references)
    targets = {*re.findall(r"url\((#[^)]*)\)", pages["first_look"]), *found.references}
    assert targets
    assert {t.removeprefix("#") for t in targets} <= set(found.ids)


def test_text_is_escaped(pages):
    assert "a &lt;b&gt; &amp; c" in pages["first_look"]


def test_the_screening_page_describes_the_residual_and_no_more(pages):
    text = pages["first_look"]
    assert "The residual depends on motor angle" in text
    assert "7 times a motor turn" in text
    assert "identifies no effect" in text
    assert "friction.coulomb, width" in text


def test_a_browser_opens_a_page_without_an_error(pages, tmp_path):
    path = write_report(tmp_path / "page.html", pages["first_look"])
    messages: list[str] = []
    with chromium() as browser:
        opened = browser.new_page()
        opened.on("console", lambda m: messages.append(m.text))
        opened.on("pageerror", lambda e: messages.append(str(e)))
        opened.goto(path.as_uri())
        assert messages == []
        assert opened.locator("svg").count() == 3


def test_figures_do_not_share_ids_and_thin_long_lines():
    time_s = np.arange(100_000) * 1e-3
    drawn = [
        figures.over_time(time_s, {"x": np.sin(time_s)}, "N m", caption) for caption in ("a", "b")
    ]
    ids = [re.findall(r'id="([^"]*)"', text) for text in drawn]
    assert not set(ids[0]) & set(ids[1])
    assert len(drawn[0]) < 100_000
    assert "currentColor" in drawn[0]


@pytest.mark.parametrize("family", sorted({e.family for e in catalogue().values()}))
def test_every_family_has_a_meaning_in_plain_words(family):
    words = meaning(family)
    assert words
    assert not words.endswith(".")


def test_sizes_are_those_of_the_wave_and_in_readable_units():
    wave = {
        "sine": Value(3e-3, "N m", None),
        "cosine": Value(4e-3, "N m", None),
        "order": Value(7.0, "1", None),
        "time": Value(0.25, "s", None),
    }
    assert sizes_of(wave) == {"amplitude": "5 mN m", "order": "7", "time": "0.25 s"}


def test_a_table_is_the_same_in_every_medium():
    from rich.console import Console

    table = TextTable("T [x]", ["a", "b"], [["p|q", "1"]], "a note")
    assert to_markdown(table) == "## T [x]\n\n| a | b |\n|---|---:|\n| p\\|q | 1 |\n\na note\n"
    written = StringIO()
    Console(width=60, file=written).print(to_rich(table))
    assert "T [x]" in written.getvalue()
    assert "p|q" in written.getvalue()


def test_provenance_names_the_commit(tmp_path):
    assert commit(tmp_path) == "unknown"
    made = Provenance.now(7)
    assert made.seed == 7
    assert "/" not in made.command
    assert re.fullmatch(r"unknown|[0-9a-f]{7,}(\+changes)?", made.commit)


def test_a_page_written_before_does_not_change_the_commit_of_the_next(tmp_path):
    def git(*words):
        author = ["-c", "user.name=n", "-c", "user.email=e"]
        subprocess.run(["git", "-C", str(tmp_path), *author, *words], check=True)

    (tmp_path / "docs").mkdir()
    page, code = tmp_path / "docs/page.md", tmp_path / "code.py"
    for path in (page, code):
        path.write_text("1\n")
    git("init", "-q")
    git("add", ".")
    git("commit", "-q", "-m", "first")
    page.write_text("2\n")
    assert re.fullmatch(r"[0-9a-f]{7,}", commit(tmp_path))
    code.write_text("2\n")
    assert commit(tmp_path).endswith("+changes")
