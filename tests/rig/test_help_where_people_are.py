"""`rig` alone, the sections that errors refer to, and the archive for a question."""

import getpass
import importlib
import json
import pkgutil
import re
import zipfile
from pathlib import Path

import pytest

import calibration
import drivers
import estimation
import rig
from rig.errors import A_BUG, KNOWN_ERRORS, PAGE, ExitCode, anchor_of
from tests.rig.log.conftest import write_log
from tests.rig.test_campaigns import diagnosed

ROOT = Path(__file__).parents[2]


def test_with_nothing_there_the_demo_and_a_configuration_are_proposed(newcomer, said):
    words = said().out
    for command in ("rig demo", "rig config init", "rig record --sim", "rig -h"):
        assert command in words


def test_a_configured_rig_without_calibration_is_to_be_calibrated(newcomer, said):
    said("config init")
    words = said().out
    assert "rig doctor" in words
    assert "rig calibrate torque" in words
    assert "rig config init" not in words


def test_a_configuration_that_cannot_be_read_is_named(newcomer, said):
    (newcomer / "rig.toml").write_text("nonsense = 1\n")
    assert "rig config check rig.toml" in said().out


@pytest.mark.parametrize("state", ["undiagnosed", "lossy", "diagnosed"])
def test_the_newest_recording_decides_what_to_do_with_it(newcomer, said, state):
    folder = newcomer / "logs" / "monday"
    folder.mkdir(parents=True)
    write_log(folder / "a.mcap", drop=frozenset({30} if state == "lossy" else ()))
    if state == "diagnosed":
        diagnosed(folder)
    expected = {
        "undiagnosed": "rig diagnose logs/monday\n",
        "lossy": "rig log check logs/monday",
        "diagnosed": "identified, ripple.motor",
    }
    assert expected[state] in said().out


def test_the_raw_logs_of_a_calibration_are_no_recording_to_diagnose(newcomer, said, answered):
    said("calibrate gearbox --sim --yes --operator Ada --out logs/a")
    assert "rig record --sim" in said().out
    (campaign,) = answered("campaigns")["campaigns"]
    assert {run["protocol"] for run in campaign["runs"]} == {"calibration of gearbox"}


def error_classes():
    """Every error that a room raises on purpose."""
    for room in (rig, drivers, estimation, calibration):
        for module in pkgutil.walk_packages(room.__path__, f"{room.__name__}."):
            if not module.name.endswith("__main__"):
                try:
                    importlib.import_module(module.name)
                except ModuleNotFoundError:  # an extra that is not installed
                    continue
    waiting, found = list(KNOWN_ERRORS), set()
    while waiting:
        kind = waiting.pop()
        found.add(kind)
        waiting += kind.__subclasses__()
    return {k for k in found if k.__module__.split(".")[0] != "tests"}


def test_every_error_has_a_section_of_the_troubleshooting_page():
    text = (ROOT / PAGE).read_text()
    headings = re.findall(r"^## (.+)$", text, re.MULTILINE)
    anchors = {re.sub(r"[^\w\- ]", "", h.lower()).replace(" ", "-") for h in headings}
    kinds = error_classes()
    assert len(kinds) > 50
    for kind in kinds:
        assert anchor_of(kind) in anchors, kind
        assert anchor_of(kind) != A_BUG, kind
    assert A_BUG in anchors


def test_an_error_names_its_section(newcomer, said):
    out, err = said("replay nothing.mcap --json", code=ExitCode.USAGE)
    assert err.splitlines()[-1] == f"  more: {PAGE}#a-command-is-refused"
    assert json.loads(out)["error"]["more"].endswith("#a-command-is-refused")


def test_a_bundle_holds_what_a_question_needs_and_no_secret(newcomer, said, monkeypatch):
    folder = newcomer / "logs" / "monday"
    folder.mkdir(parents=True)
    write_log(folder / "a.mcap", drop=frozenset({30}))
    monkeypatch.setenv("HOME", str(newcomer))
    text = said("config show --sim").out
    text = text.replace('name = "simulated rig"', 'name = "rig of //ada:hunter2@host token=abc123"')
    (newcomer / "rig.toml").write_text(text)
    assert "question.zip" in said("doctor --bundle question.zip").out
    with zipfile.ZipFile(newcomer / "question.zip") as archive:
        content = {name: archive.read(name).decode() for name in archive.namelist()}
    names = ("versions", "findings", "configuration", "calibrations", "newest_campaign")
    assert set(content) == {f"{name}.json" for name in names}
    assert json.loads(content["versions.json"])["packages"]["numpy"]
    assert json.loads(content["newest_campaign.json"])["checks"][0]["problems"]
    whole = "".join(content.values())
    assert "rig of //***@host token=***" in whole
    for secret in ("hunter2", "abc123", str(newcomer)):
        assert secret not in whole
    user = getpass.getuser()
    assert len(user) < 3 or not re.search(rf"\b{re.escape(user)}\b", whole)


def test_a_bundle_does_not_replace_another_kind_of_file(newcomer, said):
    log = write_log(newcomer / "a.mcap")
    before = log.read_bytes()
    said("doctor --sim --bundle", log, code=ExitCode.USAGE)
    assert log.read_bytes() == before
