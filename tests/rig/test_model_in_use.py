"""The model in use: chosen once, and then that of the live display, replays, pages and exports."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from estimation import model_file
from estimation.campaign import Campaign
from estimation.fitting import fit
from rig.configuration.config import SHIPPED, load_config
from rig.configuration.model_in_use import choose
from rig.importers.registry import open_campaign
from rig.live.block import through
from rig.live.estimator import estimators_of
from rig.live.session_blocks import session_blocks
from rig.log.convert import write_recording
from rig.log.reader import read_log
from tests.estimation.synthetic import run
from tests.rig.simulated import simulated, transport

pytestmark = pytest.mark.integration

GRIP = "distal_torque_n_m"
SHIPPED_MODEL = SHIPPED / "simulated_grip.model.toml"


@pytest.fixture(autouse=True)
def home(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "home"))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def model(path: Path) -> Path:
    return Path(path.write_text(SHIPPED_MODEL.read_text()) and path)


def test_a_model_is_used_by_every_session_of_its_rig_until_taken_back(home, answered):
    assert load_config().model_path == SHIPPED_MODEL
    assert simulated().changed(model="mine.npz").model_path == Path("mine.npz")
    used = answered("model use", model(home / "mine.toml"))
    assert used["replaced"] == str(SHIPPED_MODEL)
    assert used["estimates"] == [GRIP]
    (home / "mine.toml").unlink()  # a copy is in use
    assert load_config().model_path.read_text() == SHIPPED_MODEL.read_text()
    assert load_config(Path("grasper")).model_path.stem.startswith("simulated_grasper")
    again = answered("model use", model(home / "other.toml"))
    assert again["replaced"] == str(used["model"])
    assert answered("model")["model"] == again["model"]
    assert answered("model use", Path(used["model"]).stem)["model"] == used["model"]
    assert answered("model reset")["replaced"] == used["model"]
    assert load_config().model_path == SHIPPED_MODEL


@pytest.mark.parametrize(
    ("words", "code", "objection"),
    [
        ("gripp", 2, "simulated_grip"),
        ("declared.toml", 5, "not fitted"),
        ("simulated_grasper --sim", 2, "which simulated rig does not measure"),
        ("simulated_grip -c reference", 2, "fitted on simulated recordings"),
    ],
)
def test_a_model_that_does_not_suit_the_rig_is_refused(home, said, words, code, objection):
    model_file.write(model_file.read(Path("motor")), home / "declared.toml")
    assert objection in said("model use", words, code=code).err
    assert load_config().model_path == SHIPPED_MODEL
    assert load_config(Path("reference")).model_path is None


def test_a_model_of_simulated_recordings_is_taken_for_a_real_rig_when_allowed(home, said):
    assert "--from-simulation" in said("model use simulated_grip -c reference", code=2).err
    said("model use simulated_grip -c reference --from-simulation")
    assert load_config(Path("reference")).model_path.stem.startswith("simulated_grip")


def test_a_choice_that_does_not_suit_is_named_with_what_takes_it_back(home, said):
    choose("simulated rig", SHIPPED / "simulated_grasper.model.toml", "2026-01-01")
    err = said("live --sim --pace 0 --duration 0.1", code=2).err
    assert "`rig model use` chose it" in err
    assert "rig model reset" in err


def test_a_fit_states_whether_its_runs_were_simulated(home, said):
    said("record --sim -p still -o runs")
    recorded = open_campaign(home / "runs").runs[0].recording()
    assert recorded.is_simulated
    write_recording(home / "again.mcap", recorded)
    assert open_campaign(home / "again.mcap").runs[0].recording().is_simulated
    runs = [run(name, 0.4, 0.1, seed=seed, seconds=3.0) for seed, name in enumerate("ab")]
    made = Campaign.of(replace(one, rig="b", is_simulated=True) for one in runs)
    fitted = fit(model_file.read(Path("motor")), made)
    model_file.write(fitted, home / "m.toml")
    assert model_file.read(home / "m.toml").evidence == fitted.evidence
    assert fitted.evidence.rig == "b"
    assert fitted.evidence.is_simulated


@pytest.fixture
def recorded(home):
    """The folder of two runs of a rig, and a fitted model of them, in a file."""
    folder = home / "kk"
    folder.mkdir()
    for seed, name in enumerate(("000-a", "001-b")):
        made = replace(run(name, 0.4, 0.1, seed=seed, seconds=3.0), rig="bench 7")
        write_recording(folder / f"{name}.mcap", made)
    fitted = fit(model_file.read(Path("motor")), open_campaign(folder))
    model_file.write(fitted, home / "motor.toml")
    return folder, fitted


def test_exports_have_the_estimate_beside_what_was_measured(recorded, home, said):
    folder, fitted = recorded
    named = f"estimated_{fitted.target}"
    words = ("log export", folder, "--model motor.toml")
    said(*words, "--out all.csv")
    with (home / "all.csv").open() as file:
        rows = list(csv.DictReader(file))
    first = open_campaign(folder).runs[0].recording()
    (estimator,) = estimators_of(home / "motor.toml", first.sample_rate_hz)
    expected = estimator.push(first.columns, first.time_s)
    mine = [float(row[named]) for row in rows if row["run"] == first.name]
    np.testing.assert_allclose(mine, expected)
    said(*words, "--format mcap --out new")
    again = open_campaign(home / "new")
    assert again.names == ("000-a", "001-b")
    np.testing.assert_array_equal(again.runs[0].recording().columns[named], expected)


def test_a_page_and_a_replay_take_the_model_in_use_for_the_recordings_rig(recorded, home, said):
    folder, fitted = recorded
    text = (SHIPPED / "simulated.toml").read_text()
    (home / "rig.toml").write_text(text.replace('"simulated rig"', '"bench 7"'))
    page = home / "p.html"
    said("view --no-open", folder, "-o", page)
    assert "estimated" not in page.read_text().split('id="charts">')[1]
    said("model use motor.toml -c rig.toml")
    said("view --no-open", folder, "-o", page)
    assert '"estimated ' in page.read_text().split('id="charts">')[1]
    frame = json.loads(said("replay --speed 0 --json", folder).out.splitlines()[10])
    assert frame["channels"][fitted.target]["estimate"] is not None


def test_what_the_live_display_records_has_the_estimate_that_was_shown(tmp_path):
    config, keys = simulated(), iter(["r", "", "", "r"])
    estimators = estimators_of(SHIPPED_MODEL, 1000.0)
    stream = session_blocks(
        config, lambda: transport(config), [], estimators, lambda: next(keys, ""), tmp_path
    )
    blocks = list(through(stream, duration_s=0.5))
    (path,) = tmp_path.glob("*.mcap")
    rows = read_log(path).topics["/rig/sample"].rows
    shown = np.concatenate([block.estimates[GRIP] for block in blocks[:3]])
    np.testing.assert_array_equal(rows[f"estimated_{GRIP}"], shown)


def test_an_estimate_outside_its_range_is_a_gap(recorded, home, monkeypatch, said):
    folder, fitted = recorded
    outside = property(lambda self: np.arange(3000) >= 1000)
    monkeypatch.setattr("rig.live.estimator.LiveEstimator.inside", outside)
    said("log export", folder, "--model motor.toml --format mcap --out gaps")
    made = open_campaign(home / "gaps").runs[0].recording()
    found = made.columns[f"estimated_{fitted.target}"]
    assert np.isnan(found[:1000]).all()
    assert np.isfinite(found[1000:]).all()
    said("view gaps --no-open -o g.html")
