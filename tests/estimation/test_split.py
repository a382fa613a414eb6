"""What comes before a search: clocks, the split, and pieces that stand for runs."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from estimation.diagnosis.audit import audit, flagged, steady
from estimation.diagnosis.split import (
    SplitError,
    claim,
    cut_and_split,
    data_hash,
    path_of,
    period_samples,
    periods,
    split,
)
from estimation.recording import Flag, Recording
from rig.importers.registry import open_campaign
from tests.estimation.synthetic import runs


def moving(seed: int = 0, **more: np.ndarray) -> Recording:
    time_s = np.arange(20000) * 1e-3
    angle = {"motor_angle_rad": np.sin(time_s), "spindle_angle_rad": np.sin(time_s) / 35}
    return Recording(f"run{seed}", time_s, {**angle, **more})


def test_skips_and_held_channels_are_reported():
    whole = [
        moving(k, load_command_a=np.full(20000, 0.1 * k), motor_current_a=np.zeros(20000))
        for k in range(4)
    ]
    time_s = whole[2].time_s.copy()
    time_s[7000:] += 0.25
    said = audit([*whole[:2], replace(whole[2], time_s=time_s), whole[3]])
    (skip,) = [s for s in said if "skips" in s]
    assert "run2 skips 1 time, the longest by 0.251 s at 7 s" in skip
    assert any(s.startswith("load_command_a is held within each run") for s in said)
    assert any(s.startswith("motor_current_a never varies") for s in said)
    assert not any("skips" in s for s in audit(whole))
    assert not any("load_command_a" in s for s in audit(whole, {"load_command_a"}))
    clocked = [r.with_columns(campaign_time_s=1e6 + r.time_s) for r in whole]
    assert not any("campaign_time_s" in s for s in audit(clocked))


def test_a_run_that_jumps_is_left_out_and_one_that_skips_or_is_flagged_is_kept():
    whole = moving()
    time_s = whole.time_s.copy()
    time_s[7000:] += 0.25
    jumps = replace(whole, name="jumps", time_s=time_s)
    flags = np.zeros(len(whole), np.uint8)
    flags[6999:7001] = 1
    flagged = replace(jumps, name="flagged", flags=flags)
    skipping = replace(whole, name="skips", time_s=np.where(time_s > 7.1, time_s - 0.24, time_s))
    kept, lost = steady([whole, jumps, flagged, skipping])
    assert [r.name for r in kept] == ["run0", "flagged", "skips"]
    assert "Run jumps is left out: its clock jumps by 0.251 s at 6.999 s" in lost[0]
    (skip,) = [s for s in audit(kept) if "skips" in s]
    assert skip.startswith("The clock of 2 runs skips 2 times, the longest by 0.251 s at")
    assert "of flagged:" in skip


def test_runs_with_many_flagged_samples_are_named():
    whole = moving()
    flags = np.zeros(len(whole), np.uint8)
    flags[300:900] = Flag.MISSING
    runs = [whole, replace(whole, name="empty", flags=flags)]
    assert flagged(runs) == ["Samples that are flagged and do not count: 600 of 20000 in empty."]
    flags = np.where(np.arange(len(whole)) < 310, flags, 0).astype(np.uint8)
    assert flagged([whole, replace(whole, name="hardly", flags=flags)]) == []


def test_the_split_is_stratified_repeatable_and_sealed():
    recordings = runs(count=12, seconds=1.0)
    first, again, other = (split(recordings, seed) for seed in (1, 1, 2))
    assert first == again
    assert first.seal != other.seal
    assert set(first.discover) | set(first.confirm) == {r.name for r in recordings}
    assert len(first.confirm) == 4
    # every frequency confirms, since the strata are cut along the conditions
    assert {r.conditions["frequency_hz"] for r in recordings if r.name in first.confirm} == {
        r.conditions["frequency_hz"] for r in recordings
    }


@pytest.mark.parametrize("seed", range(6))
def test_the_ends_of_every_condition_discover(seed):
    recordings = runs(count=12, seconds=1.0)
    kept = [r for r in recordings if r.name in split(recordings, seed).discover]
    for name in ("frequency_hz", "load_command_a"):
        values = [[r.conditions[name] for r in some] for some in (kept, recordings)]
        assert [min(values[0]), max(values[0])] == [min(values[1]), max(values[1])]


@pytest.mark.parametrize("seed", range(8))
def test_speeds_that_take_turns_are_all_trained_and_both_ends_are_tested(seed):
    """Without stated conditions each run has the speed that its channels have."""
    time_s = np.arange(2000) * 1e-2
    speeds = [(1.0, 2.0, 4.0)[k % 3] for k in range(12)]
    taken = [
        Recording(f"run{k:02d}", time_s, {"motor_angle_rad": np.sin(w * time_s + k)})
        for k, w in enumerate(speeds)
    ]
    sealed = split(
        [replace(r, columns={**r.columns, "motor_velocity_rad_s": w * np.cos(w * time_s)})
         for r, w in zip(taken, speeds, strict=True)],
        seed,
    )  # fmt: skip
    of_run = dict(zip([r.name for r in taken], speeds, strict=True))
    assert {of_run[name] for name in sealed.discover} == {1.0, 2.0, 4.0}
    assert {of_run[name] for name in sealed.confirm} >= {1.0, 4.0}


def test_the_data_hash_follows_the_samples():
    one = runs(count=3, seconds=1.0)
    changed = [one[0].with_columns(motor_current_a=one[0]["motor_current_a"] + 1e-12), *one[1:]]
    assert data_hash(one) == data_hash(list(reversed(one)))
    assert data_hash(one) != data_hash(changed)


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
    pieces, sealed = cut_and_split(both, 0)
    assert {p.name for p in pieces} == {*sealed.discover, *sealed.confirm}
    assert len({path_of(n) for n in sealed.discover}) == 1
    assert {path_of(n) for n in (*sealed.discover, *sealed.confirm)} == {"one", "two"}
    assert cut_and_split(both, 0)[1] == sealed
    # the one that nobody has seen confirms, whatever the seed
    for seed in range(4):
        assert path_of(cut_and_split(both, seed, {"two"})[1].confirm[0]) == "one"
    said = claim(sealed)
    assert f"{len(sealed.discover)} periods" in said
    assert "these two paths" in said


def test_a_path_that_does_not_repeat_itself_is_refused() -> None:
    drift = path("one")
    aimless = np.cumsum(np.random.default_rng(0).normal(size=len(drift)))
    with pytest.raises(SplitError, match="does not repeat"):
        cut_and_split([drift.with_columns(joint_1_angle_rad=aimless), path("two")])
    still = path("two").with_columns(joint_1_angle_rad=np.zeros(len(drift)))
    with pytest.raises(SplitError, match="does not repeat"):
        cut_and_split([drift, still])
    with pytest.raises(SplitError, match="2 rigs"):
        cut_and_split([drift, replace(path("two"), rig="another")])


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
    pieces, sealed = cut_and_split(few)
    assert sum(map(len, pieces)) == sum(map(len, few))
    assert {path_of(piece.name) for piece in pieces} == {r.name for r in few}
    assert len(sealed.discover) >= 6
    assert sealed.confirm
    assert f"{number} recording" in (claim(sealed) or "")


def test_enough_or_too_short_recordings_stay_whole() -> None:
    for recordings in (
        [path(f"run {k}", seed=k) for k in range(8)],
        [path(f"run {k}", seed=k, seconds=6.0) for k in range(3)],
    ):
        whole, sealed = cut_and_split(recordings)
        assert [r.name for r in whole] == [r.name for r in recordings]
        assert claim(sealed) is None
    with pytest.raises(SplitError, match="too few"):
        cut_and_split([path("one", seconds=9.0)])


def held_at(conditions: list[dict[str, float | str]]) -> list[Recording]:
    """Return short runs under these conditions."""
    time_s = np.arange(100) * 1e-2
    angle = {"motor_angle_rad": np.sin(time_s)}
    return [
        Recording(f"run{k:02d}", time_s, angle, conditions=own) for k, own in enumerate(conditions)
    ]


def levels_tested(recordings: list[Recording], seed: int, name: str) -> set[float | str]:
    """Return the levels of a condition that the test runs have."""
    confirm = split(recordings, seed).confirm
    return {r.conditions[name] for r in recordings if r.name in confirm}


SPEEDS, FORCES = (0.25, 0.4, 0.7, 1.0), (0.0, 60.0, 120.0, 180.0)


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("turns", [1, 3])
def test_every_level_of_every_condition_is_trained_and_tested(seed, turns):
    """Each force comes with three of four speeds; by the name, force is the first condition."""
    held = [
        {"force_n": force, "speed_hz": SPEEDS[(turns * k + j) % 4]}
        for k, force in enumerate(FORCES)
        for j in range(3)
    ]
    recordings = held_at(held)
    sealed = split(recordings, seed)
    assert len(sealed.confirm) == 4
    for name, levels in (("force_n", FORCES), ("speed_hz", SPEEDS)):
        assert levels_tested(recordings, seed, name) == {*levels}
        kept = {r.conditions[name] for r in recordings if r.name in sealed.discover}
        assert kept == {*levels}


@pytest.mark.parametrize("seed", range(8))
def test_a_condition_of_which_each_run_has_its_own_level_is_tested_low_and_high(seed):
    random = np.random.default_rng(seed)
    warmth = random.permutation(15)
    recordings = held_at([{"load": float(k % 3), "warmth": float(w)} for k, w in enumerate(warmth)])
    found = levels_tested(recordings, seed, "warmth")
    assert min(found) < 5
    assert max(found) >= 10
    assert not {0.0, 14.0} & found


def test_what_no_earlier_diagnosis_has_seen_is_tested_although_a_level_is_then_missing():
    recordings = held_at([{"a": float(k % 2), "b": float(k // 6)} for k in range(12)])
    seen = {r.name for r in recordings if r.conditions["b"] == 1.0}
    assert not seen & {*split(recordings, 0, seen).confirm}


def test_runs_whose_first_condition_alone_differs_keep_the_test_runs_of_their_strata():
    recordings = held_at([{"a": 0.1 * k, "b": "same"} for k in range(12)])
    confirm = split(recordings, 5).confirm
    strata = [[r.name for r in recordings[k : k + 3]] for k in range(0, 12, 3)]
    assert [len({*stratum} & {*confirm}) for stratum in strata] == [1, 1, 1, 1]
