"""Pages of HTML: well formed, without references to anything outside, and quiet in a browser."""

import re
import subprocess
from html.parser import HTMLParser
from io import StringIO

import numpy as np
import pytest

from estimation.diagnosis.result import Finding, Value
from estimation.effects import catalogue
from rig.output import figures
from rig.output.provenance import Provenance, commit
from rig.output.table import TextTable, to_markdown, to_rich
from rig.reports import recordings
from rig.reports.diagnosis_words import meaning, sizes_of
from tests.estimation.synthetic import campaign

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


def test_a_page_is_well_formed_and_its_text_escaped():
    runs = campaign(lambda angle, speed, load: 0.0 * speed)
    text = recordings.page(runs, "a <b> & c", Provenance.now(1))
    found = Page(text)
    assert found.open == []
    assert len(found.ids) == len(set(found.ids))
    assert all(reference.startswith("#") for reference in found.references)
    assert "a &lt;b&gt; &amp; c" in text


def test_figures_do_not_share_ids_and_thin_long_lines():
    time_s = np.arange(100_000) * 1e-3
    drawn = [
        figures.over_time(time_s, {"x": np.sin(time_s)}, "N m", caption) for caption in ("a", "b")
    ]
    ids = [re.findall(r'id="([^"]*)"', text) for text in drawn]
    assert not set(ids[0]) & set(ids[1])
    assert len(drawn[0]) < 100_000
    assert "currentColor" in drawn[0]


def test_every_family_has_a_meaning_in_plain_words():
    for family in {effect.family for effect in catalogue().values()}:
        words = meaning(family)
        assert words, family
        assert not words.endswith("."), family


@pytest.mark.parametrize(
    ("along", "repeats"),
    [
        ("motor_angle", {"": "7 per turn of the motor angle"}),
        ("table_position", {"period": "0.898 m"}),
    ],
)
def test_sizes_are_those_of_the_wave_and_in_readable_units(along, repeats):
    wave = {
        "sine": Value(3e-3, "N m", None),
        "cosine": Value(4e-3, "N m", None),
        "order": Value(7.0, "1", None),
        "time": Value(0.25, "s", None),
    }
    finding = Finding(
        balance="motor",
        place="motor",
        family="ripple.motor",
        verdict="identified",
        depends_on=(along,),
        parameters=wave,
    )
    assert sizes_of(finding) == {"amplitude": "5 mN m", "time": "0.25 s"} | repeats


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
