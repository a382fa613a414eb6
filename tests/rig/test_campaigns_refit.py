"""`rig campaigns --refit`: one model on every campaign, kept, and when its parameters changed."""

from concurrent.futures import BrokenExecutor, Executor, Future
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from estimation.model_file import read, to_toml
from rig.campaigns.drift import changes
from rig.diagnosis.refit import refit_all
from rig.log.convert import write_recording
from tests.estimation.synthetic import TRUE
from tests.estimation.synthetic import run as synthetic_run

DAY_NS = 86_400 * 10**9


@pytest.fixture
def root(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    for day in range(3):
        folder = tmp_path / "logs" / f"day-{day}"
        folder.mkdir(parents=True)
        for k, load in enumerate((0.05, 0.1)):
            run = synthetic_run(f"{k}", 0.3 + 0.2 * k, load, seed=10 * day + k, seconds=4.0)
            started = 1_750_000_000_000_000_000 + day * DAY_NS
            write_recording(folder / f"{k}.mcap", replace(run, started_at_ns=started))
    return tmp_path / "logs"


def test_each_campaign_is_fitted_once_until_its_logs_change(root, answered):
    words = ("campaigns --refit motor --root", root)
    found = answered(*words)["campaigns"]
    assert [Path(row["folder"]).name for row in found] == ["day-0", "day-1", "day-2"]
    for row in found:
        gain = row["fit"]["values"]["motor.torque_constant.gain"]
        assert gain == pytest.approx(TRUE["gain"], rel=0.05)
        assert row["fit"]["runs"] == 2
    kept = {path: path.stat().st_mtime_ns for path in root.glob("*/fit/*.json")}
    assert len(kept) == 3
    (root / "day-1" / "1.mcap").unlink()
    answered(*words)
    again = {path.parent.parent.name for path in kept if path.stat().st_mtime_ns != kept[path]}
    assert again == {"day-1"}


def test_a_campaign_that_cannot_be_fitted_is_named_and_the_others_are_fitted(root, said):
    for path in (root / "day-1").glob("*.mcap"):
        path.unlink()
        run = synthetic_run(path.stem, 0.3, 0.05, seed=1, seconds=1.0)
        rest = {name: run[name] for name in run.columns if name != "motor_current_a"}
        write_recording(path, replace(run, columns=rest))
    out = said("campaigns --refit motor --root", root).out
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


def test_a_lost_process_loses_nothing(root):
    pools, fitted = iter([Dying(), Dying(), None]), []

    @contextmanager
    def start():
        yield next(pools)

    folders = sorted(root.iterdir())
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
