"""`rig fit --model states`, `rig adapt` and `rig export` from recordings to files."""

import json
from dataclasses import replace

import numpy as np
import pytest

from estimation.campaign import Campaign
from estimation.estimator import load
from estimation.estimators.bank import BankEstimator
from estimation.estimators.network import NetworkEstimator
from estimation.networks.network import Network
from estimation.recording import Instrument, Recording
from rig.cli.main import main
from rig.errors import UsageError
from rig.importers.registry import open_campaign
from rig.log.convert import write_recording
from rig.models.adapt import runs_by_rule
from tests.estimation.synthetic import campaign

pytestmark = pytest.mark.integration

TARGET = "proximal_torque_n_m"


def other(run: Recording) -> Recording:
    """Return the run as of an instrument with another zero and another spring."""
    changed = run.with_columns(**{TARGET: run[TARGET] + 0.02 + 0.03 * run["spindle_angle_rad"]})
    return replace(changed, instrument=Instrument(model="Maryland", serial="2"))


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    source, target = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("target")
    for k, run in enumerate(campaign()):
        own = replace(run, instrument=Instrument(model="Maryland", serial="1"))
        write_recording(source / f"{k:02}.mcap", replace(own, name=f"{k:02}"))
        write_recording(target / f"{k:02}.mcap", replace(other(run), name=f"{k:02}"))
    return source, target


@pytest.fixture(scope="module")
def states(folders, tmp_path_factory):
    path = tmp_path_factory.mktemp("model") / "states.npz"
    assert main(["fit", str(folders[0]), "--model", "states", "--out", str(path)]) == 0
    return path


def test_replay_refuses_another_instrument_unless_allowed(folders, states, capsys):
    words = ["replay", str(folders[1] / "00.mcap"), "--model", str(states), "--speed", "0"]
    assert main([*words, "--plain"]) != 0
    assert "fitted on Maryland 1" in capsys.readouterr().err
    assert main([*words, "--plain", "--any-instrument"]) == 0


def test_replay_states_why_a_run_at_another_level_has_no_interval(folders, tmp_path, capsys):
    slow, fast = (read_first(folders[0], f"{k:02}") for k in (0, 8))
    level = slow.conditions["frequency_hz"]
    assert level != fast.conditions["frequency_hz"]
    same = [run for run in open_campaign(folders[0]) if run.conditions["frequency_hz"] == level]
    (tmp_path / "slow").mkdir()
    for run in same:
        write_recording(tmp_path / "slow" / f"{run.name}.mcap", run)
    path = tmp_path / "slow.npz"
    assert main(["fit", str(tmp_path / "slow"), "--model", "states", "--out", str(path)]) == 0
    for name, states_why in (("00", False), ("08", True)):
        words = ["replay", str(folders[0] / f"{name}.mcap"), "--model", str(path), "--speed", "0"]
        capsys.readouterr()
        assert main([*words, "--plain"]) == 0
        assert ("was fitted at one level of frequency_hz" in capsys.readouterr().err) is states_why


def read_first(folder, name: str) -> Recording:
    """Return a recording of a folder."""
    (found,) = open_campaign(folder / f"{name}.mcap")
    return found


def test_adapt_reports_the_runs_not_used_and_keeps_the_estimator(folders, states, tmp_path):
    found, new = tmp_path / "a.json", tmp_path / "new.npz"
    words = ["adapt", str(states), str(folders[1]), "--runs", "01,05"]
    assert main([*words, "--json-out", str(found), "--out", str(new)]) == 0
    result = json.loads(found.read_text())
    assert len(result["used"]) == 2
    assert len(result["unused"]) == 7
    assert set(result["rmse_by_run"]) == set(result["unused"])
    assert result["adapted"]["rmse"] < 0.5 * result["as_it_is"]["rmse"]
    assert result["scratch"]["rmse"] < result["as_it_is"]["rmse"]
    by_run = np.array(list(result["rmse_by_run"].values()))
    assert by_run.min() <= result["adapted"]["rmse"] <= by_run.max()
    kept = load(new)
    assert isinstance(kept, BankEstimator)
    assert kept.instrument == "Maryland 2"


def test_runs_to_adapt_with_are_chosen_by_their_conditions_alone(folders, states, tmp_path):
    estimator, campaign = load(states), open_campaign(folders[1])
    chosen = runs_by_rule(estimator, campaign, 3)
    assert len(set(chosen)) == 3
    assert chosen[:1] == runs_by_rule(estimator, campaign, 1)
    other_truth = Campaign.of([run.with_columns(**{TARGET: -run[TARGET]}) for run in campaign])
    assert runs_by_rule(estimator, other_truth, 3) == chosen
    found = tmp_path / "a.json"
    words = ["adapt", str(states), str(folders[1]), "--choose", "3", "--no-scratch"]
    assert main([*words, "--json-out", str(found)]) == 0
    assert set(json.loads(found.read_text())["used"]) == set(chosen)
    with pytest.raises(UsageError, match="too few to choose 9"):
        runs_by_rule(estimator, campaign, 9)


def test_a_fit_and_an_adaptation_refuse_to_write_over_a_file(folders, states, capsys):
    before = states.read_bytes()
    for words in (
        ["fit", str(folders[0]), "--model", "states"],
        ["fit", str(folders[0]), "--model", "linear"],
        ["adapt", str(states), str(folders[1]), "--runs", "01"],
    ):
        assert main([*words, "--out", str(states)]) == 2
        assert "is there already" in capsys.readouterr().err
    assert states.read_bytes() == before


def test_a_network_s_output_layer_moves_to_another_instrument(folders, tmp_path, capsys):
    draw = np.random.default_rng(0)
    inputs = ("spindle_angle_rad", "motor_current_a")
    network = Network(
        inputs, (TARGET,), np.array([[-0.7, -0.2], [0.7, 0.5]]), np.array([[-0.1], [0.4]]),
        draw.normal(size=(6, 3)), draw.normal(size=(1, 7)),
    )  # fmt: skip
    path, new = tmp_path / "network.npz", tmp_path / "new.npz"
    NetworkEstimator(network).save(path)
    words = ["adapt", str(path), str(folders[1]), "--runs", "01,05", "--no-scratch"]
    assert main([*words, "--json", "--out", str(new)]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["kind"] == "network"
    assert result["scratch"] is None
    assert result["adapted"]["rmse"] < 0.5 * result["as_it_is"]["rmse"]
    moved = load(new)
    assert isinstance(moved, NetworkEstimator)
    np.testing.assert_array_equal(moved.network.hidden, network.hidden)


def test_what_adapt_cannot_do_is_reported(folders, states, tmp_path, capsys):
    assert main(["adapt", str(states), str(folders[1]), "--runs", "77"]) == 2
    assert "names 0 runs" in capsys.readouterr().err
    line = tmp_path / "line.toml"
    assert main(["fit", str(folders[0]), "--model", "linear", "--out", str(line)]) == 0
    assert main(["adapt", str(line), str(folders[1]), "--runs", "01"]) == 2
    assert "cannot be adapted" in capsys.readouterr().err
    words = ["fit", str(folders[0]), "--model", "states", "--surrogate", "jaw_angle_rad"]
    assert main(words) == 2


def test_export_writes_a_header(states, tmp_path):
    out = tmp_path / "grip.h"
    assert main(["export", str(states), "--out", str(out)]) == 0
    assert "static inline grip_estimate grip_step" in out.read_text()
