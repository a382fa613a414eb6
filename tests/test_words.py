"""Prose uses the terms of the field (docs/glossary.md): a ban list of home-made words.

Prose is every Markdown page and every string with a space in a Python file: messages, help,
docstrings. Tests, the change log and the generated pages of results are not read.
"""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
ROOMS = ("rig", "drivers", "estimation", "calibration", "firmware", "benchmarks", "docs", "logs")

BANNED: dict[str, tuple[str, str]] = {
    r"told": (
        "it has four meanings",
        "identified, reported, attributed or distinguishable",
    ),
    r"tells?": ("only people tell", "shows, identifies, distinguishes or reports"),
    r"(?<![Tt]here )is no(?! longer\b| more\b)": ("a negation in disguise", "is not a"),
    r"balances?(?! ?[=:])": ("a scale, to most readers", "equation, torque equation"),
    r"confirm runs?": ("home-made", "held-out test runs"),
    r"ledger of looks|(first|second) looks?": ("home-made", "access log; use of held-out data"),
    r"wander(s|ed|ing)?": ("home-made", "random walk, drift"),
    r"twins?": ("it has three meanings", "simulated null, reference implementation"),
    r"rivals?": ("effects do not compete", "competing hypothesis, alternative"),
    r"beside": ("it has three meanings", "next to, together with, conditional on"),
    r"leaves?(?!-one)": ("it has three meanings", "residual; quits; exceeds"),
    r"hardly": ("old-fashioned", "barely; poorly identifiable; nearly"),
    r"stand-ins?": ("home-made", "predicted signal, substitute"),
    r"by heart": ("people learn by heart", "overfits, leaks"),
    r"bent": ("home-made for a relaxed functional form", "relaxed form; biased"),
    r"imitates?": ("causes do not imitate", "mimics, is collinear with"),
    r"anew": ("old-fashioned", "again, restarted"),
    r"[Ss]ay (whether|why|which)": ("functions do not speak", "Whether X; Return why X"),
    r"Return what": ("it hides the noun", "Return the X of Y"),
    r"borne out": ("old-fashioned", "confirmed"),
}
"""Pattern of a word -> the reason against it, and what to write."""

RIGHT = {
    "estimation/effects/friction_capstan.py": ("straight and bent",),
    "estimation/effects/ripple_output.py": ("bent shaft",),
    "estimation/effects/sensor_crosstalk.py": ("bent mount",),
}
"""Page -> the places in it where a banned word has its ordinary meaning."""


def banned(text: str) -> Iterator[tuple[int, str]]:
    """Yield the offset of each banned word in a text, and what to write instead."""
    for pattern, (reason, instead) in BANNED.items():
        for found in re.finditer(rf"\b(?:{pattern})\b", text):
            yield found.start(), f"{found[0]!r} ({reason}): write {instead}"


def prose(path: Path) -> Iterator[tuple[int, str]]:
    """Yield the texts of a file that a person reads, each with the number of its first line."""
    content = path.read_text(encoding="utf-8")
    if path.suffix == ".md":
        yield 1, content
        return
    for node in ast.walk(ast.parse(content)):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and " " in node.value:
            yield node.lineno, node.value


def pages() -> list[str]:
    """Return the files with prose, relative to the project's folder."""
    found = [*ROOT.glob("*.md")]
    for room in ROOMS:
        found += [p for p in (ROOT / room).rglob("*") if p.suffix in (".py", ".md")]
    names = sorted(p.relative_to(ROOT).as_posix() for p in found)
    generated = ("CHANGELOG.md", "docs/results/", "firmware/build/")
    return [name for name in names if not name.startswith(generated)]


def test_prose_has_no_home_made_words():
    faults = []
    for name in pages():
        for line, text in prose(ROOT / name):
            for place in RIGHT.get(name, ()):
                text = text.replace(place, "_" * len(place))
            for offset, advice in banned(text):
                faults.append(f"{name}:{line + text.count(chr(10), 0, offset)}: {advice}")
    assert not faults, "\n".join(faults)


def test_every_exception_is_still_needed():
    for name, places in RIGHT.items():
        texts = [text for _, text in prose(ROOT / name)]
        for place in places:
            assert any(place in text for text in texts), f"{name} has no {place!r} any more"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("These runs do not tell the gain.", ["tell"]),
        ("The motor balance leaves 3 mN m.", ["balance", "leaves"]),
        ("It is no sensor.", ["is no"]),
        ("There is no file: it is no longer here.", []),
        ("rig diagnose LOGS --equation motor", []),
        ('balance = "motor"', []),
        ("leave-one-run-out cross-validation", []),
    ],
)
def test_a_banned_word_is_found_and_its_ordinary_use_is_not(text, words):
    found = [advice.split("'")[1] for _, advice in sorted(banned(text))]
    assert found == words
