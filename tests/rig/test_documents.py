"""Tables in the documentation are those of the code."""

from pathlib import Path

import pytest

from estimation.channels import CHANNELS, UNIT_BY_SUFFIX
from estimation.recording import Flag
from rig.errors import ExitCode

DOCS = Path(__file__).parents[2] / "docs"


def rows(document, heading):
    """Return the cells of the table under a column heading, without the heading."""
    lines = (DOCS / document).read_text(encoding="utf-8").splitlines()
    start = next(i for i, line in enumerate(lines) if line.startswith(f"| {heading} |"))
    found = []
    for line in lines[start + 2 :]:
        if not line.startswith("|"):
            break
        found.append([cell.strip() for cell in line.strip("|").split("|")])
    return found


def test_exit_codes_are_documented():
    documented = [(int(code), name) for code, name, _ in rows("exit-codes.md", "code")]
    assert documented == [(int(code), code.name.lower()) for code in ExitCode]


def test_channels_are_documented():
    assert rows("signs-and-units.md", "channel") == [
        [f"`{c.name}`", c.unit, c.description] for c in CHANNELS.values()
    ]


def test_unit_suffixes_are_documented():
    assert rows("signs-and-units.md", "suffix") == [
        [f"`_{suffix}`", unit] for suffix, unit in UNIT_BY_SUFFIX.items()
    ]


def test_flags_are_documented():
    documented = [(int(bit), name) for bit, name, _ in rows("signs-and-units.md", "bit")]
    assert documented == [(int(f), f.name.lower()) for f in Flag if f]


@pytest.mark.parametrize("path", sorted((DOCS / "decisions").glob("*.md")), ids=lambda p: p.stem)
def test_a_decision_has_its_three_parts(path):
    text = path.read_text(encoding="utf-8")
    number = int(path.name[:4])
    assert text.startswith(f"# {number}. ")
    headings = [line for line in text.splitlines() if line.startswith("## ")]
    assert headings == ["## Context", "## Decision", "## Consequences"]
