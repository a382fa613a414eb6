"""Tables in the documentation are those of the code."""

from pathlib import Path

import pytest

from estimation.channels import CHANNELS, UNIT_BY_SUFFIX
from estimation.plant import ACCELERATION, POSITION, SPEED
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


SIGNS = "signs-and-units.md"
OF_AN_AXIS = [
    [quantity, f"`{endings['rad']}`", f"`{endings['m']}`"]
    for quantity, endings in (
        ("position", POSITION),
        ("speed", SPEED),
        ("acceleration, derived", ACCELERATION),
        ("effort, load", {"rad": "_n_m", "m": "_n"}),
    )
]


@pytest.mark.parametrize(
    ("document", "heading", "expected"),
    [
        ("exit-codes.md", "code", [[str(int(c)), c.name.lower()] for c in ExitCode]),
        (SIGNS, "channel", [[f"`{c.name}`", c.unit, c.description] for c in CHANNELS.values()]),
        (SIGNS, "suffix", [[f"`_{suffix}`", unit] for suffix, unit in UNIT_BY_SUFFIX.items()]),
        ("your-own-machine.md", "quantity of an axis", OF_AN_AXIS),
        (SIGNS, "bit", [[str(int(f)), f.name.lower()] for f in Flag if f]),
    ],
    ids=["exit codes", "channels", "suffixes", "an axis", "flags"],
)
def test_a_table_is_that_of_the_code(document, heading, expected):
    assert [row[: len(expected[0])] for row in rows(document, heading)] == expected


@pytest.mark.parametrize("path", sorted((DOCS / "decisions").glob("*.md")), ids=lambda p: p.stem)
def test_a_decision_has_its_three_parts(path):
    text = path.read_text(encoding="utf-8")
    number = int(path.name[:4])
    assert text.startswith(f"# {number}. ")
    headings = [line for line in text.splitlines() if line.startswith("## ")]
    assert headings == ["## Context", "## Decision", "## Consequences"]
