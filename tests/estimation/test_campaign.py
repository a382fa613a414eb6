"""Campaigns: lazy runs, their common time, splits by run."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimation.campaign import Campaign, CampaignError, Run
from estimation.recording import Flag, Recording, Stretch


def run(name: str, load_a: float = 0.1, count: int = 1000):
    return Recording(
        name,
        np.arange(count) * 1e-3,
        {"motor_current_a": np.full(count, load_a)},
        conditions={"load_command_a": load_a},
    )


def test_a_campaign_is_walked_run_by_run():
    loaded: list[str] = []

    def handle(name: str) -> Run:
        def load() -> Recording:
            loaded.append(name)
            return run(name)

        return Run(name, load)

    campaign = Campaign(tuple(handle(n) for n in "abc"))
    walk = iter(campaign)
    assert loaded == []
    assert next(walk).name == "a"
    assert loaded == ["a"]


def test_two_runs_of_one_name_are_refused():
    with pytest.raises(CampaignError, match="share a name: a"):
        Campaign.of([run("a"), run("a")])


@given(st.integers(2, 12), st.integers(2, 12), st.integers(0, 5))
def test_folds_test_every_run_once_and_never_fit_on_it(runs, folds, seed):
    campaign = Campaign.of([run(f"r{i}", count=3) for i in range(runs)])
    if folds > runs:
        with pytest.raises(CampaignError, match="cannot be split"):
            campaign.folds(folds, seed)
        return
    splits = campaign.folds(folds, seed)
    tested = [name for split in splits for name in split.test.names]
    assert sorted(tested) == sorted(campaign.names)
    assert all(not set(s.train.names) & set(s.test.names) for s in splits)
    assert all(len(s.train) + len(s.test) == runs for s in splits)


def test_leave_one_condition_out_holds_out_whole_levels():
    campaign = Campaign.of([run(f"r{i}", load_a=0.1 * (1 + i % 3)) for i in range(9)])
    splits = campaign.leave_one_condition_out("load_command_a")
    assert len(splits) == 3
    for split in splits:
        inside = {r.conditions["load_command_a"] for r in split.test}
        outside = {r.conditions["load_command_a"] for r in split.train}
        assert len(inside) == 1
        assert not inside & outside


def test_leave_one_condition_out_needs_the_condition_and_two_levels():
    campaign = Campaign.of([run("a"), run("b")])
    with pytest.raises(CampaignError, match="does not state"):
        campaign.leave_one_condition_out("frequency_hz")
    with pytest.raises(CampaignError, match="no runs to fit"):
        campaign.leave_one_condition_out("load_command_a")


def test_an_excluded_run_is_kept_with_its_reason_but_is_no_evidence():
    campaign = Campaign.of([run("a"), run("b")]).exclude({"b": "the cable slipped"})
    assert [r.excluded for r in campaign] == [None, "the cable slipped"]
    assert campaign.evidence.names == ("a",)
    with pytest.raises(CampaignError, match="no run 'z'"):
        campaign.exclude({"z": "?"})


def test_concatenation_leaves_out_flagged_samples_and_excluded_runs():
    flagged = run("a").with_stretch(Stretch(0.0, 0.0995, Flag.SUSPECT, "start transient"))
    campaign = Campaign.of([flagged, run("b"), run("c").exclude("test")])
    table = campaign.concatenate(["motor_current_a"])
    assert table.columns["motor_current_a"].shape == (1900,)
    assert np.bincount(table.run).tolist() == [900, 1000]
    assert table.names == ("a", "b")
    whole = campaign.concatenate(["motor_current_a"], valid_only=False)
    assert whole.columns["motor_current_a"].shape == (2000,)
