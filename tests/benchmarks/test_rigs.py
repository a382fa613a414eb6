from functools import cache

import numpy as np
import pytest

from benchmarks.diagnosis.case import write_recordings
from benchmarks.rigs import CALIBRATE, DEVELOP, JUDGE, Case, draw, part_of
from benchmarks.rigs.residual import EQUATIONS, Fitted, Prepared, declared, fit, prepare
from benchmarks.rigs.stage import EPOCH_NS
from estimation.campaign import with_campaign_time
from estimation.causes.verdict import diagnose
from estimation.diagnosis.split import split
from estimation.recording import Recording
from rig.importers.registry import open_campaign

pytestmark = pytest.mark.integration

FIRST = DEVELOP.start


@cache
def case_of(kind: str, seed: int = FIRST) -> Case:
    return draw(seed, kind)


def prepared(case: Case, recordings: tuple[Recording, ...]) -> list[Prepared]:
    return [prepare(recording, case.stage.plant.ratio) for recording in recordings]


def left(case: Case, recordings: tuple[Recording, ...]) -> dict[str, Fitted]:
    runs = prepared(case, recordings)
    return {equation: fit(runs, equation) for equation in EQUATIONS}


@pytest.mark.parametrize("kind", ["clean", pytest.param("strong", marks=pytest.mark.long)])
def test_a_seed_and_kind_give_the_same_samples_every_time(kind):
    one, other = draw(FIRST + 1, kind), case_of(kind, FIRST + 1)
    for first, second in zip(one.recordings, other.recordings, strict=True):
        assert first.conditions == second.conditions
        for name in first.columns:
            np.testing.assert_array_equal(first[name], second[name])


@pytest.mark.parametrize(("kind", "low", "high"), [("strong", 2.2, 5.0), ("weak", 1.25, 1.9)])
def test_the_stated_strength_is_what_the_declared_model_shows(kind, low, high):
    case = case_of(kind)
    (effect,) = case.truth.effects
    without, with_it = left(case, tuple(case.twin)), left(case, case.recordings)
    ratio = with_it[effect.equation].rms(effect.runs) / without[effect.equation].rms(effect.runs)
    assert ratio == pytest.approx(effect.strength, rel=1e-6)
    assert low <= ratio <= high
    for equation in EQUATIONS:
        assert case.truth.clean_rms[equation] == pytest.approx(without[equation].rms())


def test_the_true_structure_leaves_what_the_clean_twin_leaves():
    case = case_of("strong")
    (effect,) = case.truth.effects
    runs = prepared(case, case.recordings)
    oracle = fit(runs, effect.equation, case.truth.columns[effect.equation])
    clean = case.truth.clean_rms[effect.equation]
    assert oracle.rms() < 1.1 * clean
    assert case.truth.with_rms[effect.equation] > 2.0 * clean


def test_a_clean_residual_is_the_noise_of_its_sensors():
    case = case_of("clean", FIRST + 1)
    assert not case.truth.effects
    stage = case.stage
    noisy = left(case, case.recordings)
    silent = left(case, tuple(stage.record(k, silent=True) for k in stage.every))
    for equation in EQUATIONS:
        assert silent[equation].rms() < 0.4 * noisy[equation].rms()


@pytest.mark.long
def test_an_effect_of_some_runs_is_in_these_alone():
    case = case_of("some_runs")
    (effect,) = case.truth.effects
    twin, there = tuple(case.twin), set(effect.runs)
    assert 0 < len(there) < len(twin)
    for k, (clean, recording) in enumerate(zip(twin, case.recordings, strict=True)):
        same = all(np.array_equal(clean[name], recording[name]) for name in clean.columns)
        assert same != (k in there)


@pytest.mark.long
def test_a_confounded_case_states_the_families_that_cannot_be_separated():
    truth = case_of("confounded").truth
    assert len(truth.together) >= 2
    assert truth.effects[0].family in truth.together


@pytest.mark.long
def test_no_family_of_a_confounded_case_has_an_amplitude_that_no_machine_has():
    # the drag of this motor falls as it warms: so would friction that falls with the load
    assert "friction.load" not in draw(FIRST + 172001, "confounded", gear_ratio=35.0).truth.together
    # the load of this one depends on the angle: so would a lever of tens of times its length
    assert "eccentric.load" not in draw(FIRST + 172003, "confounded", gear_ratio=35).truth.together


@pytest.mark.long
def test_an_effect_outside_the_catalogue_has_no_name_but_variables():
    (effect,) = case_of("outside").truth.effects
    assert effect.family == "unknown"
    assert effect.variables


@pytest.mark.long
def test_a_faulty_sensor_does_not_move_the_plant():
    faulty = (case_of("strong", FIRST + k) for k in range(14))
    case = next(c for c in faulty if c.truth.effects[0].family.startswith("sensor."))
    others = list(next(iter(case.twin)).columns)
    for clean, recording in zip(case.twin, case.recordings, strict=True):
        changed = [n for n in others if not np.array_equal(clean[n], recording[n])]
        assert len(changed) == 1


@pytest.mark.long
def test_what_only_the_weighted_error_shows_is_no_finding():
    runs = [
        with_campaign_time(r, EPOCH_NS) for r in draw(1171005, "clean", gear_ratio=35.0).recordings
    ]
    assert not diagnose(runs, [declared(name) for name in EQUATIONS], split(runs)).findings


def test_written_logs_read_back_equal(tmp_path):
    case = case_of("clean", FIRST + 1)
    write_recordings(tmp_path / "runs", case.recordings)
    read = list(open_campaign(tmp_path / "runs"))
    assert [r.name for r in read] == [r.name for r in case.recordings]
    for one, other in zip(case.recordings, read, strict=True):
        assert one.conditions == other.conditions
        assert one.started_at_ns == other.started_at_ns
        np.testing.assert_array_equal(one.time_s, other.time_s)
        for name in one.columns:
            np.testing.assert_array_equal(one[name], other[name])


def test_ranges_of_seeds_are_apart():
    assert CALIBRATE.stop <= DEVELOP.start < DEVELOP.stop <= JUDGE.start
    assert [part_of(r[0]) for r in (CALIBRATE, DEVELOP, JUDGE)] == ["calibrate", "develop", "judge"]
