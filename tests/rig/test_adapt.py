"""`rig fit --model states`, `rig adapt`, `rig export`, and `rig estimator compare` of the files."""

import json
from dataclasses import replace

import numpy as np
import pytest

from estimation.campaign import Campaign
from estimation.estimator import load
from estimation.estimators.bank import BankEstimator
from estimation.estimators.network import NetworkEstimator
from estimation.estimators.origin import data_hash
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


def test_replay_refuses_another_instrument_unless_allowed(folders, states, said):
    words = ("replay", folders[1] / "00.mcap", "--speed 0 --plain --model", states)
    assert "fitted on Maryland 1" in said(*words, code=5).err
    said(*words, "--any-instrument")


def test_replay_states_why_a_run_at_another_level_has_no_interval(folders, tmp_path, said):
    runs = {run.name: run for run in open_campaign(folders[0])}
    level = runs["00"].conditions["frequency_hz"]
    assert level != runs["08"].conditions["frequency_hz"]
    (tmp_path / "slow").mkdir()
    for run in runs.values():
        if run.conditions["frequency_hz"] == level:
            write_recording(tmp_path / "slow" / f"{run.name}.mcap", run)
    path = tmp_path / "slow.npz"
    said("fit", tmp_path / "slow", "--model states --out", path)
    for name, states_why in (("00", False), ("08", True)):
        words = ("replay", folders[0] / f"{name}.mcap", "--speed 0 --plain --model", path)
        assert ("was fitted at one level of frequency_hz" in said(*words).err) is states_why


def test_adapt_reports_the_runs_not_used_and_keeps_the_estimator(
    folders, states, tmp_path, answered
):
    new = tmp_path / "new.npz"
    result = answered("adapt", states, folders[1], "--runs 01,05 --out", new)
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


def test_runs_to_adapt_with_are_chosen_by_their_conditions_alone(folders, states, tmp_path, said):
    estimator, campaign = load(states), open_campaign(folders[1])
    chosen = runs_by_rule(estimator, campaign, 3)
    assert len(set(chosen)) == 3
    assert chosen[:1] == runs_by_rule(estimator, campaign, 1)
    other_truth = Campaign.of([run.with_columns(**{TARGET: -run[TARGET]}) for run in campaign])
    assert runs_by_rule(estimator, other_truth, 3) == chosen
    found = tmp_path / "a.json"
    said("adapt", states, folders[1], "--choose 3 --no-scratch --json-out", found)
    assert set(json.loads(found.read_text())["used"]) == set(chosen)
    with pytest.raises(UsageError, match="too few to choose 9"):
        runs_by_rule(estimator, campaign, 9)


def test_a_run_at_another_zero_is_asked_about_and_not_chosen(folders, states, tmp_path, said):
    chosen = runs_by_rule(load(states), open_campaign(folders[1]), 1)
    for k, run in enumerate(open_campaign(folders[1])):
        zero = 0.1 * k + (30.0 if run.name in chosen else 0.0)
        conditions = {**run.conditions, "motor_zero_offset_rad": zero}
        write_recording(tmp_path / f"{run.name}.mcap", replace(run, conditions=conditions))
    assert runs_by_rule(load(states), open_campaign(tmp_path), 1) != chosen
    printed = said("adapt", states, tmp_path, "--no-scratch").out
    assert f"Check: motor_zero_offset_rad: {chosen[0]} has its zero at 3" in " ".join(
        printed.split()
    )


def test_a_fit_and_an_adaptation_refuse_to_write_over_a_file(folders, states, said):
    before = states.read_bytes()
    for words in (
        ("fit", folders[0], "--model states"),
        ("fit", folders[0], "--model linear"),
        ("adapt", states, folders[1], "--runs 01"),
    ):
        assert "is there already" in said(*words, "--out", states, code=2).err
    assert states.read_bytes() == before


def test_a_network_s_output_layer_moves_to_another_instrument(folders, tmp_path, answered):
    draw = np.random.default_rng(0)
    inputs = ("spindle_angle_rad", "motor_current_a")
    network = Network(
        inputs, (TARGET,), np.array([[-0.7, -0.2], [0.7, 0.5]]), np.array([[-0.1], [0.4]]),
        draw.normal(size=(6, 3)), draw.normal(size=(1, 7)),
    )  # fmt: skip
    path, new = tmp_path / "network.npz", tmp_path / "new.npz"
    NetworkEstimator(network).save(path)
    words = ("adapt", path, folders[1], "--runs 01,05 --no-scratch --out", new)
    result = answered(*words)
    assert result["kind"] == "network"
    assert result["scratch"] is None
    assert result["adapted"]["rmse"] < 0.5 * result["as_it_is"]["rmse"]
    moved = load(new)
    assert isinstance(moved, NetworkEstimator)
    np.testing.assert_array_equal(moved.network.hidden, network.hidden)


def test_what_adapt_cannot_do_is_reported(folders, states, tmp_path, said):
    refused = said("adapt", states, folders[1], "--runs 77", code=2).err
    assert "names 0 runs" in refused
    assert "fix: Give their whole names: --runs 00,01." in refused
    most = len(list(folders[1].iterdir())) - 1
    refused = said("adapt", states, folders[1], "--choose 30", code=2).err
    assert f"fix: Give --choose {most} or less." in refused
    line = tmp_path / "line.toml"
    said("fit", folders[0], "--model linear --out", line)
    assert "cannot be adapted" in said("adapt", line, folders[1], "--runs 01", code=2).err
    said("fit", folders[0], "--model states --surrogate jaw_angle_rad", code=2)


def test_what_is_no_model_is_named_by_its_kind(states, tmp_path, said):
    notes, header = tmp_path / "notes.txt", tmp_path / "grip.h"
    notes.write_text("Bench 3.\n")
    refused = said("export", notes, "--out", header, code=5).err
    assert "It is a text file." in refused
    assert "fix: Name a file that rig fit or rig adapt wrote" in refused
    assert "pickle" not in refused
    refused = said("export", states, "--out", header, "--equation grip", code=2).err
    assert "--equation grip cannot be used" in refused
    assert not header.exists()
    refused = said("record --sim -p still --out", tmp_path / "logs", "-m", states, code=5).err
    assert "is an estimator (.npz), not a model file." in refused
    assert "fix: Fit one: rig fit LOGS --out FILE.toml." in refused


def test_export_writes_a_header(states, tmp_path, said):
    said("export", states, "--out", tmp_path / "grip.h")
    assert "static inline grip_estimate grip_step" in (tmp_path / "grip.h").read_text()


OFF_N_M = 0.1
"""More than the half width of the estimator's interval in a part of every run."""


@pytest.fixture(scope="module")
def worse(states, tmp_path_factory):
    path = tmp_path_factory.mktemp("worse") / "worse.npz"
    estimator = load(states)
    off = estimator.weights.copy()
    off[0] += OFF_N_M
    replace(estimator, weights=off, origin=None).save(path)
    return path


def test_a_fit_states_its_data_by_hash_the_code_and_its_error(states, folders):
    origin = load(states).origin
    assert len(origin.data) == len(list(folders[0].iterdir()))
    assert len(set(origin.data.values())) == len(origin.data)
    assert origin.code.startswith("rig ")
    assert 0 < origin.figures["held_out_rmse"] <= origin.figures["held_out_p95"]


def test_a_hash_is_of_the_samples_alone():
    first, second, *_ = campaign()
    assert data_hash(replace(first, name="other", notes="later")) == data_hash(first)
    changed = first[TARGET].copy()
    changed[100] = np.nextafter(changed[100], 1.0)
    assert data_hash(first.with_columns(**{TARGET: changed})) != data_hash(first)
    assert data_hash(second) != data_hash(first)


def test_an_adapted_estimator_states_its_own_runs_and_its_source(states, folders, tmp_path, said):
    out = tmp_path / "adapted.npz"
    said("adapt", states, folders[0], "--runs 01,05 --no-scratch --out", out)
    origin = load(out).origin
    assert set(origin.data) == {"01", "05"}
    assert origin.data.items() <= load(states).origin.data.items()
    assert origin.adapted_from
    assert "unused_runs_rmse" in origin.figures


@pytest.mark.parametrize("swapped", [False, True])
def test_the_better_one_is_found_whichever_comes_first(states, worse, folders, said, swapped):
    files = (worse, states) if swapped else (states, worse)
    printed = said("estimator compare --json", *files, "--on", folders[0])
    found = json.loads(printed.out)
    for part in ("states.npz is better", "worse.npz", "does not state what it was made from"):
        assert part in printed.err
    place = int(swapped)
    assert found["rmse"][place] < found["rmse"][1 - place]
    assert len(found["sides"][place]["seen"]) == len(found["runs"])
    for run in found["runs"]:
        assert run["mean"][1 - place] - run["mean"][place] == pytest.approx(OFF_N_M)
        assert run["covered"][place] > run["covered"][1 - place]


def test_an_estimator_is_not_better_than_itself(states, folders, said):
    printed = said("estimator compare", states, states, "--on", folders[0])
    assert "do not show which is better" in printed.out


def test_estimators_of_different_channels_are_refused(states, folders, tmp_path, said):
    other = tmp_path / "other.npz"
    replace(load(states), target="distal_torque_n_m").save(other)
    printed = said("estimator compare", states, other, "--on", folders[0], code=2)
    assert "different channels" in printed.err
