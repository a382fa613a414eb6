"""Tables, figures, commands and templates of the documentation are the program's; the site."""

import html
import re
import runpy
import shlex
import sys
from functools import cache
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import click
import numpy as np
import pytest
import typer

from benchmarks import results
from drivers.errors import LinkError
from estimation.channels import CHANNELS, UNIT_BY_SUFFIX
from estimation.effects import UnknownEffectError, catalogue, effect
from estimation.model_file import names
from estimation.plant import ACCELERATION, POSITION, SPEED
from estimation.recording import Flag
from rig.cli.main import app
from rig.errors import ExitCode
from tests.estimation import test_effects as contract

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"


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


FIGURES = DOCS / "figures"


@pytest.mark.parametrize("path", sorted(FIGURES.glob("*.svg")), ids=lambda p: p.stem)
def test_a_figure_is_a_file_that_a_browser_shows(path):
    assert ElementTree.parse(path).getroot().tag == "{http://www.w3.org/2000/svg}svg"  # noqa: S314


def words(svg):
    return html.unescape(svg).replace("\xa0", " ")


def test_figure_shows_what_the_display_shows_now():
    drawn = words(runpy.run_path(str(FIGURES / "live_display.py"))["draw"]())
    kept = words((FIGURES / "live.svg").read_text(encoding="utf-8"))
    for wanted in ("mN m", "at the jaw tip (lever 12 mm)", "lost 0", "1000 Hz", "teensy"):
        assert wanted in drawn
    texts = [part.split("</text>")[0] for part in drawn.split("<text")[1:]]
    stale = [t.split(">", 1)[1] for t in texts if t.split(">", 1)[1] not in kept]
    assert not stale, "run python docs/figures/live_display.py: the figure no longer matches"


def test_the_figure_of_the_grasper_can_be_drawn():
    drawn = words(runpy.run_path(str(FIGURES / "grasper_display.py"))["draw"]())
    assert "Grasp force, estimate" in drawn
    assert "? help" in drawn


PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(DOCS.glob("*.md"))]
PAGES += sorted((DOCS / "results").glob("*.md"))
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


EXTENDING = DOCS / "extending.md"
MODULE = re.compile(r'```python title="(\w+)\.py"\n(.*?)```', re.DOTALL)
ENTRY = re.compile(r"```toml\n\[project\.entry-points\.\"([\w.]+)\"\]\n(\w+) = \"(.*?)\"\n```")


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Put the page's modules and entry points on the path, as pip would."""

    def _install(changed=lambda text: text):
        text = EXTENDING.read_text()
        for name, code in MODULE.findall(text):
            (tmp_path / f"{name}.py").write_text(changed(code))
            monkeypatch.delitem(sys.modules, name, raising=False)
        info = tmp_path / "acme-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text("Metadata-Version: 2.1\nName: acme\nVersion: 1.0\n")
        entries = [f"[{group}]\n{name} = {value}\n" for group, name, value in ENTRY.findall(text)]
        (info / "entry_points.txt").write_text("\n".join(entries))
        monkeypatch.syspath_prepend(tmp_path)
        catalogue.cache_clear()

    yield _install
    monkeypatch.undo()
    catalogue.cache_clear()


def test_the_templates_effect_keeps_the_contract_of_every_effect(install, said):
    install()
    kind = effect("friction.cubic")
    contract.test_an_effect_is_documented_and_its_parameters_have_units_and_bounds(kind)
    contract.test_a_search_may_enter_it_in_each_balance_it_names_with_units(kind)
    contract.test_a_sample_that_is_not_finite_spoils_no_later_one(kind)
    contract.test_columns_stay_finite_on_constant_and_repeated_samples(kind, 0.4)
    assert "cube of speed" in said("effects friction.cubic").out


def test_the_templates_importer_opens_its_files(install, tmp_path, said):
    install()
    folder = tmp_path / "bench"
    folder.mkdir()
    time_s = np.arange(4000) / 1000
    torque_n_m = 0.3 * np.sin(time_s)
    rows = np.column_stack([time_s * 1e3, 400 * torque_n_m, torque_n_m * 1e2])
    np.savetxt(folder / "a.acme", rows)
    said("log export", folder, "--format csv --out", tmp_path / "t.csv")
    head = (tmp_path / "t.csv").read_text().splitlines()[0]
    assert '"motor_current_a","proximal_torque_n_m"' in head


def test_the_logger_alone_runs_as_its_page_states(capsys):
    text = (DOCS / "one-khz.md").read_text()
    opened, whole = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    with pytest.raises(LinkError, match="16c0:0483"):
        exec(opened, {})  # noqa: S102  no board is plugged in here
    exec(whole, {})  # noqa: S102
    assert re.match(r"1\d{3} samples, 0 lost\n", capsys.readouterr().out)


def test_an_effect_that_does_not_load_or_takes_a_name_is_refused(install):
    install(lambda code: code.replace("friction.cubic", "friction.drag"))
    with pytest.raises(UnknownEffectError, match=r"acme.*friction\.drag"):
        catalogue()


@pytest.mark.integration
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
