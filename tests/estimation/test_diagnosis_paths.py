"""Two recorded paths: whole periods stand for runs, and the claim states it."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from estimation.diagnosis.paths import (
    claim,
    path_of,
    period_samples,
    periods,
    split_few,
    split_paths,
)
from estimation.diagnosis.split import SplitError
from estimation.recording import Recording
from rig.importers.registry import open_campaign


def path(name: str, period_s: float = 2.5, seconds: float = 18.0, seed: int = 0) -> Recording:
    random = np.random.default_rng(seed)
    time_s = np.arange(round(seconds * 200)) / 200
    w = 2 * np.pi / period_s
    waves = random.normal(size=(2, 4))
    angle = sum(a * np.sin(k * w * time_s + b) for k, (a, b) in enumerate(waves.T, start=1))
    noise = 1e-3 * random.normal(size=len(time_s))
    return Recording(
        name, time_s, {"joint_1_angle_rad": angle + noise, "joint_1_torque_n_m": noise}
    )


@pytest.mark.parametrize("period_s", [1.5, 2.5, 4.0])
@pytest.mark.parametrize("seed", range(4))
def test_the_period_is_found_and_cut_whole(period_s: float, seed: int) -> None:
    one = path("one", period_s, seed=seed)
    assert period_samples(one) == pytest.approx(200 * period_s, abs=2)
    pieces = periods(one)
    length = period_samples(one)
    assert {len(piece) for piece in pieces[:-1]} == {length}
    assert length // 2 <= len(pieces[-1]) <= length
    assert len(one) - sum(map(len, pieces)) <= length // 2
    assert pieces[1].time_s[0] > pieces[0].time_s[-1]


def test_one_path_discovers_and_the_other_confirms() -> None:
    both = [path("one", seed=1), path("two", 3.0, seed=2)]
    pieces, sealed = split_paths(both, 0)
    assert {p.name for p in pieces} == {*sealed.discover, *sealed.confirm}
    assert len({path_of(n) for n in sealed.discover}) == 1
    assert {path_of(n) for n in (*sealed.discover, *sealed.confirm)} == {"one", "two"}
    assert split_paths(both, 0)[1] == sealed
    # the one that nobody has seen confirms, whatever the seed
    for seed in range(4):
        assert path_of(split_paths(both, seed, {"two"})[1].confirm[0]) == "one"
    said = claim(sealed)
    assert f"{len(sealed.discover)} periods" in said
    assert "these two paths" in said


def test_a_path_that_does_not_repeat_itself_is_refused() -> None:
    drift = path("one")
    aimless = np.cumsum(np.random.default_rng(0).normal(size=len(drift)))
    with pytest.raises(SplitError, match="does not repeat"):
        split_paths([drift.with_columns(joint_1_angle_rad=aimless), path("two")])
    still = path("two").with_columns(joint_1_angle_rad=np.zeros(len(drift)))
    with pytest.raises(SplitError, match="does not repeat"):
        split_paths([drift, still])
    with pytest.raises(SplitError, match="2 rigs"):
        split_paths([drift, replace(path("two"), rig="another")])


@pytest.mark.measured
def test_the_measured_paths_of_the_arm_repeat_themselves() -> None:
    data = Path(os.environ.get("RIG_DATA", Path(__file__).parents[3] / "shared" / "data")) / "psm"
    if not data.exists():
        pytest.skip(f"no measured data in {data}")
    for run in open_campaign(data):
        assert period_samples(run) / run.sample_rate_hz == pytest.approx(6.48, rel=0.01)
        assert len(periods(run)) == 5


@pytest.mark.parametrize("number", [1, 3, 4, 6])
def test_few_recordings_are_cut_into_parts_that_stand_for_runs(number: int) -> None:
    few = [path(f"run {k}", seed=k, seconds=25.0) for k in range(number)]
    pieces, sealed = split_few(few)
    assert sum(map(len, pieces)) == sum(map(len, few))
    assert {path_of(piece.name) for piece in pieces} == {r.name for r in few}
    assert len(sealed.discover) >= 6
    assert sealed.confirm
    said = claim(sealed)
    assert said is not None
    assert f"{number} recording" in said


def test_enough_or_too_short_recordings_stay_whole() -> None:
    for recordings in (
        [path(f"run {k}", seed=k) for k in range(8)],
        [path(f"run {k}", seed=k, seconds=6.0) for k in range(3)],
    ):
        runs, sealed = split_few(recordings)
        assert [r.name for r in runs] == [r.name for r in recordings]
        assert claim(sealed) is None


def test_a_recording_too_short_to_cut_is_refused() -> None:
    with pytest.raises(SplitError, match="too few"):
        split_few([path("one", seconds=9.0)])
