"""Campaigns: lazy runs, their common time, splits by run."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimation.campaign import Campaign, CampaignError, Run
from estimation.recording import Recording


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


def test_an_excluded_run_is_kept_with_its_reason_but_is_no_evidence():
    campaign = Campaign.of([run("a"), run("b")]).exclude({"b": "the cable slipped"})
    assert [r.excluded for r in campaign] == [None, "the cable slipped"]
    assert campaign.evidence.names == ("a",)
    with pytest.raises(CampaignError, match="no run 'z'"):
        campaign.exclude({"z": "?"})
