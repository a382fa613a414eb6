"""The rows of networks and of states of `rig study oneill`, on a small analytic campaign."""

import json
from dataclasses import replace

import numpy as np
import pytest

from estimation.networks.training import Settings, has_torch
from rig.errors import DataError
from rig.studies.oneill import data, states_page
from rig.studies.oneill import networks as study
from rig.studies.oneill import networks_page as shown
from rig.studies.oneill import states as oneill_states
from rig.studies.oneill.data import CAUSAL, Source, closing_table, held_out_masks
from rig.studies.oneill.network_jobs import CHANNELS, jobs
from rig.studies.oneill.networks import NetworkStudy, Training, run_networks
from rig.studies.oneill.paper import DISTAL, JAW, PAPER, PROXIMAL
from rig.studies.oneill.state_rows import StateJob
from rig.studies.oneill.states import run_states
from tests.estimation.synthetic import campaign_with_jaw

pytestmark = pytest.mark.long

torch_only = pytest.mark.skipif(not has_torch(), reason="torch is not installed (extra learn)")
QUICK = Settings(iterations=4)


@pytest.fixture(scope="module")
def table():
    return closing_table(campaign_with_jaw(), CHANNELS)


def test_masks_hold_out_whole_runs_conditions_or_samples(table):
    (mask,) = held_out_masks(table, "random", 0)
    assert mask.mean() == pytest.approx(0.15, abs=1e-3)
    for protocol, count in (("run-wise", 5), ("lofo", 3), ("lopo", 3)):
        masks = held_out_masks(table, protocol, 0)
        assert len(masks) == count
        assert np.all(np.sum(masks, axis=0) == 1)
        assert all(not set(table.run[m]) & set(table.run[~m]) for m in masks)
    folds = [
        {f"{r // 3}{r % 3}" for r in set(table.run[m])}
        for m in held_out_masks(table, "run-wise", 3)
    ]
    assert folds == [set(split.test.names) for split in campaign_with_jaw().folds(5, 3)]
    bare = replace(table, conditions={**table.conditions, "frequency_hz": np.full(9, np.nan)})
    assert held_out_masks(bare, "lofo", 0) == []


def test_the_table_holds_each_channel_without_lag_and_as_live(table):
    live, offline = (table[[p + PROXIMAL]][:, 0] for p in (CAUSAL, ""))
    assert 0 < np.sqrt(np.mean((live - offline) ** 2)) < 0.01
    with pytest.raises(DataError, match="wrist_roll_rad"):
        closing_table(campaign_with_jaw(), CHANNELS, ("wrist_roll_rad",))


def test_an_estimate_holds_no_more_than_half_a_second_and_no_target():
    for job in jobs(("neutral", "pitch", "roll")):
        names = {name.removeprefix(CAUSAL) for name in job.inputs}
        assert not names & {"time_s", "load_command_a", DISTAL, JAW}
        assert (PROXIMAL in names) == (job.surrogate == "sensor")
        assert all(name.startswith(CAUSAL) for name in job.inputs) or job.way != "causal"


def test_every_row_of_the_papers_tables_has_a_job():
    planned = {
        (job.pose, job.way, target, job.surrogate)
        for job in jobs(("neutral", "pitch", "roll"))
        if job.protocol == "random"
        for target in job.targets
    }
    assert set(PAPER) <= planned
    assert len(PAPER) == 4 + 9 + 9 + 10 + 10


@pytest.fixture(scope="module")
def deep(table, tmp_path_factory) -> NetworkStudy:
    if not has_torch():
        pytest.skip("torch is not installed (extra learn)")
    training = Training(tmp_path_factory.mktemp("state"), QUICK, every=40)
    whole = study.jobs

    def few(poses):
        kept = [("end-to-end", "command"), ("staged", "command"), ("+ travel", "command")]
        return [
            j
            for j in whole(poses)
            if (j.way, j.surrogate) in kept and j.protocol in ("random", "lofo")
        ]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(study, "jobs", few)
        calls: list[tuple[int, int]] = []
        found = run_networks({"neutral": table}, training, on_network=lambda *c: calls.append(c))
        assert calls[-1][0] == calls[-1][1] > 0
        calls.clear()
        again = run_networks({"neutral": table}, training, on_network=lambda *c: calls.append(c))
        assert calls == []  # all kept
        assert again.rows == found.rows
    return found


def test_rows_are_scored_next_to_the_paper(deep):
    assert deep.not_run == ()
    assert {row.way for row in deep.rows} == {"end-to-end", "staged", "+ travel"}
    error = {(r.way, r.protocol, r.target): r.score.rmse for r in deep.rows}
    assert error["+ travel", "lofo", PROXIMAL] < error["end-to-end", "lofo", PROXIMAL]
    (held_out,) = shown.tables(deep)
    assert "a frequency (LOFO)" in held_out.columns
    assert deep.grip_force is not None
    assert any("Grip force at 12 mm" in note for note in shown.notes(deep))


@torch_only
def test_the_command_reports_what_it_could_not_train(tmp_path, monkeypatch, said):
    monkeypatch.setattr(
        data,
        "open_reference",
        lambda path: Source(campaign_with_jaw(), "analytic rig", measured=False),
    )
    words = ("study oneill --networks --minutes 0 --json --data", tmp_path)
    printed = said(*words, "--state", tmp_path / "s", "--out", tmp_path / "d.md")
    assert json.loads(printed.out)["networks"]["rows"] == []
    assert "Not run" in printed.err
    assert "Not run" in (tmp_path / "d.md").read_text()


EFFECT = "load of the last 0.5 s"


@pytest.fixture(scope="module")
def states():
    with pytest.MonkeyPatch.context() as patch:
        kinds = [StateJob("neutral", "current", PROXIMAL, protocol=p) for p in ("run-wise", "lofo")]
        kinds += [replace(kind, filters="live") for kind in kinds]
        kinds += [StateJob("neutral", "command", t, without=e)
                  for e in ("", EFFECT) for t in (PROXIMAL, DISTAL, JAW)]  # fmt: skip
        patch.setattr(oneill_states, "jobs", lambda poses: kinds)
        done: list[tuple[int, int]] = []
        found = run_states(
            campaign_with_jaw(), None, on_row=lambda k, total: done.append((k, total))
        )
    assert done[-1] == (len(kinds), len(kinds))
    return found


def test_every_run_is_held_out_once_and_the_claims_are_shares(states):
    for row in states.rows:
        assert row.runs == 9
        assert 0 <= row.covered_worst <= row.covered_median <= 1
        low, high = row.covered_between
        assert row.covered_worst <= low <= row.covered <= high <= 1
        assert 0 <= row.inside <= 1
        assert row.run_offset <= row.score.rmse * 1.5


def test_an_unseen_frequency_is_harder_than_an_unseen_run(states):
    by = {r.job.protocol: r for r in states.rows if r.job.surrogate == "current"}
    assert by["lofo"].score.rmse > by["run-wise"].score.rmse
    assert by["lofo"].inside < by["run-wise"].inside  # its speed was never fitted


def test_the_tables_hold_the_rows(states):
    errors, levels, intervals, ablation = states_page.tables(states)
    assert len(errors.rows) == 5  # three by command, two by current; frequencies in a column
    assert len(levels.rows) == 1
    assert len(intervals.rows) == 7
    assert [row[0] for row in ablation.rows] == ["nothing", EFFECT]
    assert any("No data of experiment 3, pitch" in note for note in states_page.notes(states))
    numbers = np.array([[float(cell) for cell in row[1:]] for row in ablation.rows])
    assert np.isfinite(numbers).all()
