"""`rig campaigns`: what is listed and found, the index, and one model fitted on every campaign."""

import json
import re
from concurrent.futures import BrokenExecutor, Executor, Future
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from estimation.model_file import read, to_toml
from rig.campaigns.drift import changes
from rig.campaigns.index import campaigns
from rig.campaigns.refit import refit_all
from rig.log.convert import write_recording
from tests.estimation.synthetic import TRUE
from tests.estimation.synthetic import run as synthetic_run
from tests.rig.log.conftest import write_log

DIAGNOSIS = {
    "schema": "rig.diagnosis/1",
    "verdict": "identified",
    "findings": [{"family": "ripple.motor"}],
    "rmse_before": {"motor": 2e-3},
    "rmse_after": {"motor": 1e-3},
    "unit": {"motor": "N m"},
}


@pytest.fixture
def root(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    folder = tmp_path / "logs"
    for name in ("monday", "tuesday"):
        (folder / name).mkdir(parents=True)
        write_log(folder / name / "a.mcap")
    return folder


@pytest.fixture
def rig(root, answered):
    return lambda *words: answered("campaigns", *words, "--root", root)


def names(found: dict) -> list[str]:
    return sorted(Path(one["folder"]).name for one in found["campaigns"])


def diagnosed(folder: Path, **other) -> None:
    (folder / "diagnosis").mkdir()
    (folder / "diagnosis" / "diagnosis.json").write_text(json.dumps(DIAGNOSIS | other))


def test_folders_are_compared_and_opened_by_their_names(root, said, monkeypatch):
    """`monday` is a word of `monday-2`, too."""
    monkeypatch.setattr("webbrowser.open", lambda url: True)
    (root / "monday-2").mkdir()
    write_log(root / "monday-2" / "a.mcap")
    for name in ("monday", "monday-2"):
        diagnosed(root / name)
        (root / name / "diagnosis" / "diagnosis.html").write_text("<!DOCTYPE html>")
    head = said("campaigns tuesday monday --compare --root", root).out.splitlines()[1]
    assert head.index("tuesday") < head.index("monday")
    assert "monday-2" not in head
    out = said("campaigns monday --open --root", root).out
    assert str(root / "monday" / "diagnosis") in out
    assert "0 of 3 campaigns" in said("campaigns friday --compare --root", root).out


def test_a_narrow_terminal_has_a_paragraph_for_each_campaign(root, said, monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("COLUMNS", "60")
    out = re.sub(r"\x1b\[[0-9;]*m", "", said("campaigns --root", root).out)
    assert "…" not in out
    assert all(len(line) <= 60 for line in out.splitlines())
    paragraph = " ".join(out.split())
    assert "tuesday: date 2" in paragraph
    assert "notes first try" in paragraph


def test_without_a_writable_cache_campaigns_are_listed_all_the_same(rig, tmp_path, monkeypatch):
    (tmp_path / "file").write_text("no folder")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert names(rig()) == ["monday", "tuesday"]


def test_campaigns_are_listed_with_what_their_logs_state(rig):
    found = rig()
    assert names(found) == ["monday", "tuesday"]
    (run,) = found["campaigns"][0]["runs"]
    assert run["rig"] == "bench 1"
    assert run["instrument"] == "Maryland 0042 3"
    assert run["date"].startswith("2026-09-21T")
    assert run["conditions"] == {"load_command_a": 0.3, "object": "spring"}
    assert run["notes"] == "first try"
    assert (run["state"], run["samples"], run["lost"]) == ("complete", 600, 0)


def test_lost_samples_and_unfinished_logs_are_stated(rig, root):
    write_log(root / "monday" / "b.mcap", drop=frozenset({30, 31, 32}))
    third = write_log(root / "monday" / "c.mcap")
    whole = third.read_bytes()
    third.unlink()
    (root / "monday" / "c.mcap.part").write_bytes(whole[: len(whole) // 2])
    runs = {Path(r["file"]).name: r for c in rig("monday")["campaigns"] for r in c["runs"]}
    assert runs["b.mcap"]["lost"] == 3
    assert runs["c.mcap.part"]["state"] == "not closed"


def test_the_index_follows_the_logs_and_reads_only_what_changed(root, tmp_path):
    index, read = tmp_path / "index", []
    assert len(campaigns(root, index, on_folder=read.append)) == 2
    assert sorted(p.name for p in read) == ["monday", "tuesday"]
    read.clear()
    assert len(campaigns(root, index, on_folder=read.append)) == 2
    assert read == []
    write_log(root / "monday" / "b.mcap")
    found = {c.folder.name: c for c in campaigns(root, index, on_folder=read.append)}
    assert [p.name for p in read] == ["monday"]
    assert len(found["monday"].runs) == 2
    (root / "tuesday" / "a.mcap").unlink()
    assert [c.folder.name for c in campaigns(root, index)] == ["monday"]


@pytest.mark.parametrize("content", [b"", b"no database at all" * 100])
def test_a_damaged_index_is_built_again(root, tmp_path, content):
    index = tmp_path / "index"
    campaigns(root, index)
    index.write_bytes(content)
    assert len(campaigns(root, index)) == 2


def test_a_file_that_is_no_log_does_not_hide_the_others(rig, root):
    (root / "monday" / "picture.mcap").write_bytes(b"PNG" * 50)
    states = {r["name"]: r["state"] for c in rig("monday")["campaigns"] for r in c["runs"]}
    assert states["a"] == "complete"
    assert len(states) == 2
    assert states["picture"] != "complete"


@pytest.mark.parametrize(
    ("terms", "found"),
    [
        (["MARYLAND"], ["monday", "tuesday"]),
        (["monday"], ["monday"]),
        (["first", "try", "tuesday"], ["tuesday"]),
        (["load_command_a>=0.3"], ["monday", "tuesday"]),
        (["load_command_a>0.3"], []),
        (["object=spring", "date>=2026-09"], ["monday", "tuesday"]),
        (["object!=spring"], []),
        (["date<2026-09"], []),
        (["verdict=identified"], ["tuesday"]),
        (["ripple.motor"], ["tuesday"]),
        (["samples=600", "lost=0"], ["monday", "tuesday"]),
    ],
)
def test_words_and_values_are_searched(rig, root, terms, found):
    diagnosed(root / "tuesday")
    assert names(rig(*terms)) == found


def test_a_condition_that_no_run_has_is_an_error_with_the_nearest_name(root, said):
    assert "'load_command_a'" in said("campaigns load_comand_a=1 --root", root, code=2).err


@pytest.mark.parametrize("value", ["abc", "0,5", ""])
def test_a_word_is_not_compared_with_a_number(root, said, value):
    """It found nothing, which looks as if nothing were recorded."""
    err = said(f"campaigns load_command_a>={value} --root", root, code=2).err
    assert f"{value!r} is not a number" in err
    assert "Write a number with a point, such as 'load_command_a>=" in err


def test_a_diagnosis_appears_when_it_is_written(rig, root):
    assert [c["diagnosis"] for c in rig()["campaigns"]] == [None, None]
    diagnosed(root / "tuesday")
    assert rig("verdict=identified")["campaigns"][0]["diagnosis"]["verdict"] == "identified"
    (root / "tuesday" / "diagnosis" / "diagnosis.json").write_text("{ not JSON")
    assert rig("verdict=identified")["campaigns"] == []


def test_tables_for_people(root, said):
    diagnosed(root / "tuesday")
    for words, parts in (
        ("", ("monday", "identified: ripple.motor", "first try", "2 of 2 campaigns")),
        ("--runs", ("monday/a.mcap", "complete")),
        ("--compare", ("error of motor", "0.002 to 0.001 N m", "tuesday")),
    ):
        out = said("campaigns", words, "--root", root).out
        assert [part for part in parts if part not in out] == []


def test_the_page_of_one_campaign_is_opened(root, said, monkeypatch):
    opened: list[str] = []
    monkeypatch.setattr("webbrowser.open", lambda url: opened.append(url) or True)
    assert "2 campaigns match" in said("campaigns --open --root", root, code=2).err
    told = said("campaigns tuesday --open --root", root, code=2).err
    assert f"rig diagnose {root / 'tuesday'}" in told
    diagnosed(root / "tuesday")
    page = root / "tuesday" / "diagnosis" / "diagnosis.html"
    page.write_text("<!doctype html>")
    said("campaigns tuesday --open --root", root)
    assert opened == [page.resolve().as_uri()]


def test_one_campaign_and_several_are_diagnosed_into_the_same_json(rig, root):
    for name in ("monday", "tuesday"):
        diagnosed(root / name)
    several = {one["folder"]: one for one in rig("--diagnose")["campaigns"]}
    (alone,) = rig("monday", "--diagnose")["campaigns"]
    assert alone == several[str(root / "monday")]


DAY_NS = 86_400 * 10**9


@pytest.fixture
def days(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    for day in range(3):
        folder = tmp_path / "logs" / f"day-{day}"
        folder.mkdir(parents=True)
        for k, load in enumerate((0.05, 0.1)):
            run = synthetic_run(f"{k}", 0.3 + 0.2 * k, load, seed=10 * day + k, seconds=4.0)
            started = 1_750_000_000_000_000_000 + day * DAY_NS
            write_recording(folder / f"{k}.mcap", replace(run, started_at_ns=started))
    return tmp_path / "logs"


def test_each_campaign_is_fitted_once_until_its_logs_change(days, answered):
    words = ("campaigns --refit motor --root", days)
    found = answered(*words)["campaigns"]
    assert [Path(row["folder"]).name for row in found] == ["day-0", "day-1", "day-2"]
    for row in found:
        gain = row["fit"]["values"]["motor.torque_constant.gain"]
        assert gain == pytest.approx(TRUE["gain"], rel=0.05)
        assert row["fit"]["runs"] == 2
    kept = {path: path.stat().st_mtime_ns for path in days.glob("*/fit/*.json")}
    assert len(kept) == 3
    (days / "day-1" / "1.mcap").unlink()
    answered(*words)
    again = {path.parent.parent.name for path in kept if path.stat().st_mtime_ns != kept[path]}
    assert again == {"day-1"}


def test_a_campaign_that_cannot_be_fitted_is_named_and_the_others_are_fitted(days, said):
    for path in (days / "day-1").glob("*.mcap"):
        path.unlink()
        run = synthetic_run(path.stem, 0.3, 0.05, seed=1, seconds=1.0)
        rest = {name: run[name] for name in run.columns if name != "motor_current_a"}
        write_recording(path, replace(run, columns=rest))
    out = said("campaigns --refit motor --root", days).out
    for part in ("day-1: ", "motor_current_a", "2 of 3 campaigns fitted"):
        assert part in out


class Dying(Executor):
    """Does one task, then is lost."""

    done = 0

    def submit(self, work, /, *args, **kwargs):
        found = Future()
        if self.done:
            found.set_exception(BrokenExecutor("a process ended"))
        else:
            self.done = 1
            found.set_result(work(*args, **kwargs))
        return found


def test_a_lost_process_loses_nothing(days):
    pools, fitted = iter([Dying(), Dying(), None]), []

    @contextmanager
    def start():
        yield next(pools)

    folders = sorted(days.iterdir())
    found = refit_all(folders, to_toml(read(Path("motor"))), start, fitted.append)
    assert list(found) == folders
    assert sorted(fitted) == folders


def test_a_change_is_found_at_its_campaign_and_noise_is_none():
    random = np.random.default_rng(0)
    noise = random.normal(1.0, 0.02, size=(100, 60))
    assert sum(bool(changes(row)) for row in noise) <= 10
    noise[:, 40:] *= 1.1
    found = [[one.first for one in changes(row)] for row in noise]
    assert sum(any(abs(first - 40) <= 1 for first in row) for row in found) >= 95
    assert changes([1.0] * 50) == []


def test_a_long_series_with_outliers_has_no_change_but_the_planted_one():
    random = np.random.default_rng(1)
    series = 1.0 + 0.02 * random.standard_t(2.0, size=(20, 800))
    assert sum(bool(changes(row)) for row in series) <= 1
    series[:, 500:] *= 1.05
    found = [[one.first for one in changes(row)] for row in series]
    assert sum(len(row) == 1 and abs(row[0] - 500) <= 10 for row in found) >= 18
