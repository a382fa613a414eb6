"""What an estimator's file states of its origin, and `rig estimator compare`."""

import json
from dataclasses import replace

import numpy as np
import pytest

from estimation.estimator import load
from estimation.estimators.origin import data_hash
from estimation.recording import Instrument
from rig.cli.main import main
from rig.log.convert import write_recording
from tests.estimation.synthetic import campaign

pytestmark = pytest.mark.long

TARGET = "proximal_torque_n_m"
OFF_N_M = 0.1
"""More than the half width of the estimator's interval in a part of every run."""


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("logs")
    for k, run in enumerate(campaign()):
        own = replace(run, name=f"{k:02}", instrument=Instrument(model="Maryland", serial="1"))
        write_recording(folder / f"{k:02}.mcap", own)
    return folder


@pytest.fixture(scope="module")
def fitted(logs, tmp_path_factory):
    path = tmp_path_factory.mktemp("models") / "good.npz"
    assert main(["fit", str(logs), "--model", "states", "--out", str(path)]) == 0
    return path


@pytest.fixture(scope="module")
def worse(fitted, tmp_path_factory):
    path = tmp_path_factory.mktemp("worse") / "worse.npz"
    estimator = load(fitted)
    off = estimator.weights.copy()
    off[0] += OFF_N_M
    replace(estimator, weights=off, origin=None).save(path)
    return path


def test_a_fit_states_its_data_by_hash_the_code_and_its_error(fitted, logs):
    origin = load(fitted).origin
    assert len(origin.data) == len(list(logs.iterdir()))
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


def test_an_adapted_estimator_states_its_own_runs_and_its_source(fitted, logs, tmp_path, said):
    out = tmp_path / "adapted.npz"
    said("adapt", fitted, logs, "--runs 01,05 --no-scratch --out", out)
    origin = load(out).origin
    assert set(origin.data) == {"01", "05"}
    assert origin.data.items() <= load(fitted).origin.data.items()
    assert origin.adapted_from
    assert "unused_runs_rmse" in origin.figures


@pytest.mark.parametrize("swapped", [False, True])
def test_the_better_one_is_found_whichever_comes_first(fitted, worse, logs, said, swapped):
    files = (worse, fitted) if swapped else (fitted, worse)
    printed = said("estimator compare --json", *files, "--on", logs)
    found = json.loads(printed.out)
    for part in ("good.npz is better", "worse.npz", "does not state what it was made from"):
        assert part in printed.err
    place = int(swapped)
    assert found["rmse"][place] < found["rmse"][1 - place]
    assert len(found["sides"][place]["seen"]) == len(found["runs"])
    for run in found["runs"]:
        assert run["mean"][1 - place] - run["mean"][place] == pytest.approx(OFF_N_M)
        assert run["covered"][place] > run["covered"][1 - place]


def test_an_estimator_is_not_better_than_itself(fitted, logs, said):
    printed = said("estimator compare", fitted, fitted, "--on", logs)
    assert "do not show which is better" in printed.out


def test_estimators_of_different_channels_are_refused(fitted, logs, tmp_path, said):
    other = tmp_path / "other.npz"
    replace(load(fitted), target="distal_torque_n_m").save(other)
    printed = said("estimator compare", fitted, other, "--on", logs, code=2)
    assert "different channels" in printed.err
