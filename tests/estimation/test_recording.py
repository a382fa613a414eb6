"""Recordings: immutable columns with units and flags. Campaigns: lazy runs, splits by run."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimation.campaign import Campaign, CampaignError, Run
from estimation.channels import UnknownUnitError, evaluate, is_same, unit_of
from estimation.recording import (
    Flag,
    MissingChannelError,
    Recording,
    RecordingError,
    Stretch,
)


def make(count: int = 100, **changes: object) -> Recording:
    time_s = np.arange(count) * 1e-3
    fields: dict[str, object] = {
        "name": "run",
        "time_s": time_s,
        "columns": {"motor_current_a": np.sin(time_s), "jaw_angle_rad": time_s},
    }
    return Recording(**{**fields, **changes})  # type: ignore[arg-type]


def test_columns_cannot_be_written_to():
    recording = make()
    with pytest.raises(ValueError, match="read-only"):
        recording["motor_current_a"][0] = 1.0
    with pytest.raises(TypeError):
        recording.columns["motor_current_a"] = np.zeros(100)  # type: ignore[index]
    with pytest.raises(ValueError, match="read-only"):
        recording.flags[0] = 1


@pytest.mark.parametrize(
    ("changes", "error", "match"),
    [
        ({"columns": {"torque_mnm": np.zeros(100)}}, UnknownUnitError, "carries no unit"),
        ({"columns": {"current": np.zeros(100)}}, UnknownUnitError, "carries no unit"),
        ({"columns": {"jaw_angle_rad": np.zeros(7)}}, RecordingError, "jaw_angle_rad has shape"),
        ({"time_s": np.array([0.0, 0.0]), "columns": {}}, RecordingError, "does not increase"),
        ({"time_s": np.array([0.0, 2.0, 1.0]), "columns": {}}, RecordingError, "does not increase"),
        ({"time_s": np.array([0.0, np.nan]), "columns": {}}, RecordingError, "does not increase"),
    ],
)
def test_what_is_no_recording_is_refused(changes, error, match):
    with pytest.raises(error, match=match):
        make(**changes)


@pytest.mark.parametrize(
    ("name", "advice"),
    [
        ("jaw_accel_rad_s2", "Did you mean 'jaw_acceleration_rad_s2'"),
        ("jaw_velocity_rad_s", "It is a derivative"),
        ("crosshead_position_m", "--machine"),
    ],
)
def test_a_missing_channel_is_answered_with_what_is_near_or_with_another_machine(name, advice):
    with pytest.raises(MissingChannelError, match=advice):
        make()[name]


def test_a_stretch_flags_its_samples_and_keeps_its_reason():
    recording = make().with_stretch(Stretch(0.010, 0.019, Flag.SATURATED, "current clipped"))
    assert recording.valid.sum() == 90
    assert recording.stretches[0].reason == "current clipped"
    assert make().valid.all()


def test_rate_and_duration():
    assert make().sample_rate_hz == pytest.approx(1000.0)
    assert make().duration_s == pytest.approx(0.099)
    with pytest.raises(RecordingError, match="no sample rate"):
        _ = make(1).sample_rate_hz
    with pytest.raises(MissingChannelError, match="Did you mean 'motor_current_a'"):
        make()["motor_curent_a"]
    axis = Recording("a", [0.0, 0.1], {"carriage_position_m": [0.0, 1.0]})
    with pytest.raises(MissingChannelError, match="mean 'carriage_acceleration_m_s2'"):
        axis["carriage_accel_m_s2"]
    with pytest.raises(MissingChannelError, match="--machine"):
        axis["motor_current_a"]


def test_a_compliance_has_the_unit_of_an_angle_by_a_torque():
    assert unit_of("compliance_rad_n_m") == "rad/(N m)"
    assert unit_of("stiffness_n_m_rad") == "N m/rad"
    units = {"target": unit_of("spindle_angle_rad"), "load": unit_of("spindle_torque_n_m")}
    assert evaluate("target / load", units) == "rad/(N m)"
    assert evaluate("1 / compliance", {"compliance": "rad/(N m)"}) == "N m/rad"
    assert is_same("rad/N m", "rad/(N m)")
    assert not is_same("rad/N m", "rad m/N")
    assert not is_same("rad/?", "rad")


def counted(names: str) -> tuple[Campaign, list[str]]:
    """Return a campaign of such runs, and the list of those that were read."""
    loaded: list[str] = []

    def handle(name: str) -> Run:
        def load() -> Recording:
            loaded.append(name)
            return make(name=name)

        return Run(name, load)

    return Campaign(tuple(handle(n) for n in names)), loaded


def test_a_held_campaign_is_read_once_and_not_where_it_is_excluded():
    campaign, loaded = counted("abc")
    held = campaign.exclude({"b": "the cable slipped"}).held()
    walks = [[run.name for run in held.evidence] for _ in range(3)]
    assert walks == 3 * [["a", "c"]]
    assert loaded == ["a", "c"]


def test_a_campaign_larger_than_memory_is_read_as_it_is_walked(monkeypatch):
    monkeypatch.setattr("estimation.campaign.MOST_HELD", 1)
    campaign, loaded = counted("ab")
    assert [run.name for run in campaign.held()] == ["a", "b"]
    assert loaded == ["a", "b"]


def test_a_campaign_is_walked_run_by_run():
    campaign, loaded = counted("abc")
    walk = iter(campaign)
    assert loaded == []
    assert next(walk).name == "a"
    assert loaded == ["a"]


def test_two_runs_of_one_name_are_refused():
    with pytest.raises(CampaignError, match="share a name: a"):
        Campaign.of([make(name="a"), make(name="a")])


@given(st.integers(2, 12), st.integers(2, 12), st.integers(0, 5))
def test_folds_test_every_run_once_and_never_fit_on_it(runs, folds, seed):
    campaign = Campaign.of([make(3, name=f"r{i}") for i in range(runs)])
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
    campaign = Campaign.of([make(name="a"), make(name="b")]).exclude({"b": "the cable slipped"})
    assert [r.excluded for r in campaign] == [None, "the cable slipped"]
    assert campaign.evidence.names == ("a",)
    with pytest.raises(CampaignError, match="no run 'z'"):
        campaign.exclude({"z": "?"})
