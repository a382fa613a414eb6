"""Notes of a diagnosis: runs that are not as the others predict, and what nothing explains."""

import re
from dataclasses import replace

import numpy as np
import pytest

from estimation.causes.remarks import late
from estimation.causes.verdict import diagnose
from estimation.diagnosis.result import Diagnosis
from estimation.diagnosis.split import split
from estimation.recording import Recording
from estimation.signals import Combination, Share, Signals
from tests.estimation.causes.synthetic import (
    axis,
    gearbox,
    geared,
    hoist,
    hoisted,
    motor,
    recordings,
    turning,
)

REMARK = "times what the other runs predict"


def ahead(k: int, scale: float) -> Recording:
    """Return a run of a crank that turns one way, with friction that is larger at low speed."""
    random, time = np.random.default_rng(k), np.arange(2000) / 250.0
    speed = scale * (2.0 + np.sin(0.8 * time + k) + 0.5 * np.sin(2.3 * time))
    angle = np.cumsum(speed) / 250.0
    torque = 0.02 * np.gradient(speed, time) + 0.05 * speed + 0.3 + np.exp(-((speed / 0.3) ** 2))
    torque += random.normal(0, 0.005, len(time))
    columns = {"crank_torque_n_m": torque, "crank_angle_rad": angle}
    return Recording(f"{k:02d}", time, columns, started_at_ns=int(1e10 * k) + 1)


def test_slow_runs_are_not_remarked_on_where_a_finding_explains_them() -> None:
    runs = [ahead(k, 0.15 if k in (0, 7) else 1.0 + 0.5 * (k % 4)) for k in range(12)]
    found = diagnose(runs, [axis()], split(runs))
    assert [f.family for f in found.findings] == ["friction.stribeck"]
    assert not [note for note in found.notes if REMARK in note]


@pytest.mark.parametrize("place", [3, 4])
def test_a_run_with_a_swapped_sign_is_the_first_note_and_takes_no_part(place: int) -> None:
    runs = turning(lambda angle, speed, acceleration: 0.0 * speed)[:8]
    wrong = runs[place].with_columns(crank_torque_n_m=-runs[place]["crank_torque_n_m"])
    with_it, without = [*runs[:place], wrong, *runs[place + 1 :]], split(runs)
    found = diagnose(with_it, [axis()], without)
    note = f"{wrong.name}: crank_torque_n_m is -1 {REMARK} for it. The run is left out;"
    assert found.notes[0].startswith(note)
    assert len(found.notes) > 1
    kept = [run for run in runs if run.name != wrong.name]
    alone = diagnose(kept, [axis()], without.without({wrong.name}))
    assert found.errors == alone.errors
    assert found.findings == alone.findings == ()


@pytest.mark.parametrize("factor", [1000.0, 0.001, 57.3, 0.105, 6.28])
def test_a_run_in_another_unit_takes_no_part_as_one_with_a_swapped_sign(factor: float) -> None:
    runs = turning(lambda angle, speed, acceleration: 0.0 * speed)[:8]
    runs[3] = runs[3].with_columns(crank_torque_n_m=factor * runs[3]["crank_torque_n_m"])
    found = diagnose(runs, [axis()], split(runs))
    assert found.notes[0].startswith(f"{runs[3].name}: crank_torque_n_m is ")
    assert found.notes[0].endswith("The run is left out; correct the unit in it to use it.")
    assert runs[3].name not in (*found.sealed.discover, *found.sealed.confirm)
    assert found.findings == ()


def test_a_factor_that_is_of_no_unit_is_remarked_on_and_the_run_stays() -> None:
    runs = turning(lambda angle, speed, acceleration: 0.0 * speed)[:8]
    runs[3] = runs[3].with_columns(crank_torque_n_m=4.448 * runs[3]["crank_torque_n_m"])
    found = diagnose(runs, [axis()], split(runs))
    assert runs[3].name in (*found.sealed.discover, *found.sealed.confirm)


def test_a_reversed_torque_is_named_and_not_the_deflection_that_is_compared_with_it() -> None:
    runs = geared()
    turned = -runs[4]["proximal_torque_n_m"]
    runs[4] = runs[4].with_columns(proximal_torque_n_m=turned)
    found = diagnose(runs, [motor(), gearbox()], split(runs))
    (note,) = [n for n in found.notes if REMARK in n]
    assert note.startswith(f"{runs[4].name}: proximal_torque_n_m is -")


@pytest.mark.parametrize(
    ("channel", "factor"),
    [("proximal_torque_n_m", -1.0), ("motor_current_a", -1.0), ("motor_current_a", 10.0)],
)
def test_the_run_that_is_apart_is_named_with_its_channel_and_no_other_run(
    channel: str, factor: float
) -> None:
    runs = recordings()
    runs[4] = runs[4].with_columns(**{channel: factor * runs[4][channel]})
    (note,) = [n for n in diagnose(runs, [motor()], split(runs)).notes if REMARK in n]
    said = re.match(rf"04: {channel} is (\S+) {REMARK} for it", note)
    assert said is not None
    assert float(said[1]) == pytest.approx(factor, rel=0.2)


@pytest.mark.parametrize("knocked", [None, 2, 5])
def test_a_run_with_a_far_larger_error_is_named(knocked: int | None) -> None:
    """A sensor that is knocked in the middle of one run follows from no other run."""
    runs = turning(lambda angle, speed, acceleration: 0.0 * speed)[:8]
    if knocked is not None:
        torque = runs[knocked]["crank_torque_n_m"].copy()
        torque[len(torque) // 2 :] += 10.0 * np.std(torque)
        runs[knocked] = runs[knocked].with_columns(crank_torque_n_m=torque)
    found = diagnose(runs, [axis()], split(runs))
    said = [re.search(r"the error in (\S+) is \S+ times", note) for note in found.notes]
    named = [match[1] for match in said if match]
    assert named == ([] if knocked is None else [runs[knocked].name])


def test_two_runs_with_far_larger_errors_are_named_together() -> None:
    """What acts in one training run and in one test run can be no finding."""
    runs = turning(lambda angle, speed, acceleration: 0.0 * speed)
    sealed = split(runs)
    odd = {sealed.discover[1], sealed.confirm[0]}
    for k, run in enumerate(runs):
        if run.name in odd:
            torque = run["crank_torque_n_m"].copy()
            torque[len(torque) // 2 :] += 10.0 * np.std(torque)
            runs[k] = run.with_columns(crank_torque_n_m=torque)
    (note,) = [n for n in diagnose(runs, [axis()], sealed).notes if "the errors in" in n]
    assert f"the errors in {', '.join(sorted(odd))} are at least" in note


@pytest.mark.parametrize(
    ("warmth", "another", "words"),
    [
        (40.0, 20.0, "It has the largest warmth of all runs: either an effect that the equation"),
        (40.0, 40.0, "Check what happened in it, or exclude the run: --exclude"),
        (20.5, 20.0, "Check what happened in it, or exclude the run: --exclude"),
    ],
)
def test_a_run_at_an_end_of_a_condition_is_not_only_to_be_excluded(
    warmth: float, another: float, words: str
) -> None:
    """Unless another run is there, too."""
    runs = turning(lambda angle, speed, acceleration: 0.0 * speed)[:8]
    peaks = [float(np.abs(np.gradient(run["crank_angle_rad"])).max()) for run in runs]
    odd = int(np.argsort(peaks)[3])
    torque = runs[odd]["crank_torque_n_m"].copy()
    torque[len(torque) // 2 :] += 10.0 * np.std(torque)
    runs = [
        replace(run, conditions={"warmth": warmth if k == odd else 20.0 + k / 7})
        for k, run in enumerate(runs)
    ]
    other = (odd + 1) % len(runs)
    runs[other] = replace(runs[other], conditions={"warmth": another})
    runs[odd] = runs[odd].with_columns(crank_torque_n_m=torque)
    found = diagnose(runs, [axis()], split(runs))
    (note,) = [one for one in found.notes if "times that in any other run" in one]
    assert words in note


def test_a_slow_run_in_another_unit_shows_in_its_mean() -> None:
    runs = hoisted()
    runs[5] = runs[5].with_columns(rope_force_n=10.0 * runs[5]["rope_force_n"])
    (note,) = [n for n in diagnose(runs, [hoist()], split(runs)).notes if REMARK in n]
    assert note.startswith("05: rope_force_n is ")


def test_a_slow_run_whose_prediction_is_mostly_noise_is_not_remarked_on() -> None:
    runs = hoisted()
    assert not [n for n in diagnose(runs, [hoist(28.0)], split(runs)).notes if REMARK in n]


def uneven(factor: float, share: float) -> tuple[list[Recording], str]:
    """Return runs that the equation predicts but for a slow part, and a test run apart from them.

    Its torque is so many times the predicted one, with a slow part of such a share of that.
    """
    random = np.random.default_rng(3)
    runs = turning(lambda angle, speed, acceleration: 0.0 * speed)
    (name, *_) = split(runs).confirm
    out = []
    for run in runs:
        slow = np.cumsum(random.normal(0, 1.0, len(run.time_s)))
        slow = (slow - slow.mean()) / slow.std()
        torque = run["crank_torque_n_m"]
        gain, part = (factor, share) if run.name == name else (1.0, 0.2)
        torque = gain * (torque + part * torque.std() * slow)
        out.append(run.with_columns(crank_torque_n_m=torque))
    return out, name


@pytest.mark.parametrize("factor", [4.448, 0.2248])
def test_a_run_in_another_unit_is_remarked_on_with_the_factor(factor: float) -> None:
    runs, name = uneven(factor, 0.2)
    (note,) = [one for one in diagnose(runs, [axis()], split(runs)).notes if REMARK in one]
    said = re.fullmatch(rf"{name}: crank_torque_n_m is (\S+) {REMARK} .*", note)
    assert said is not None
    assert float(said[1]) == pytest.approx(factor, rel=0.15)


def test_a_run_that_a_factor_explains_worse_than_the_others_is_not_remarked_on() -> None:
    runs, _ = uneven(0.3, 0.55)
    found = diagnose(runs, [axis()], split(runs))
    assert not [note for note in found.notes if REMARK in note]


def test_a_short_delay_may_be_the_damping_of_a_flexible_part_between_two_angles() -> None:
    shares = (Share("motor_angle_rad", over=80.0), Share("knee_angle_rad", times=-1.0))
    geared = Signals((Combination("spring_rad", shares),))
    of_knee = late({"knee_angle_rad": 1.2e-3}, geared), late({"knee_angle_rad": 1.2e-3}, Signals())
    ((bent,), (rigid,)) = of_knee
    assert "1.2 ms later than the other angles" in bent
    assert bent.endswith("part between motor_angle_rad and knee_angle_rad shows in the same way.")
    assert "Damping" not in rigid
    (other,) = late({"hip_angle_rad": 1.2e-3}, geared)
    assert "Damping" not in other


@pytest.mark.parametrize("noise_rad", [2e-4, 0.0])
def test_noise_of_an_acceleration_is_named_where_it_is_most_of_the_error(noise_rad: float) -> None:
    random, runs = np.random.default_rng(0), []
    for run in turning(lambda *_: 0.0):
        angle = run["crank_angle_rad"] + random.normal(0.0, noise_rad, len(run))
        runs.append(run.with_columns(crank_angle_rad=angle))
    found = diagnose(runs, [axis()], split(runs))
    said = " ".join(found.notes)
    whose = "crank: most of that error is noise of crank_angle_rad in crank_acceleration_rad_s2."
    assert "Most of it is noise." in said
    assert (f"{whose} A cutoff_hz below" in said) == (noise_rad > 0.0)


def test_a_note_is_made_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("estimation.causes.remarks.late", lambda *_: ["Twice.", "Twice."])
    runs = turning(lambda *_: 0.0)[:6]
    assert diagnose(runs, [axis()], split(runs)).notes.count("Twice.") == 1


def test_a_term_that_differs_is_stated_of_the_fewer_runs() -> None:
    pairs = zip(turning(lambda *_: 0.0), turning(lambda _, speed, __: 0.02 * speed), strict=True)
    runs = [one if k in (1, 5, 8) else two for k, (one, two) in enumerate(pairs)]
    (finding,) = diagnose(runs, [axis()], split(runs)).findings
    assert (finding.family, finding.runs_affected) == ("friction.viscous", ("01", "05", "08"))
    assert finding.parameters["change"].value == pytest.approx(-0.02, rel=0.1)


@pytest.mark.parametrize("also", [(), (0,)])
def test_runs_that_share_a_condition_with_no_other_are_linked_to_it(also: tuple[int, ...]) -> None:
    pairs = zip(turning(lambda *_: 0.0), turning(lambda _, speed, __: 0.02 * speed), strict=True)
    acts = (1, 5, 8)
    runs = [
        replace(
            one if k in acts else two,
            conditions={"day": k, "payload_kg": 2.0 if k in acts + also else 5.0 * (k % 2)},
        )
        for k, (one, two) in enumerate(pairs)
    ]
    found = diagnose(runs, [axis()], split(runs))
    linked = [note for note in found.notes if "are exactly those of" in note]
    said = "crank: the 3 runs in which friction.viscous acts are exactly those of payload_kg 2: it"
    assert [note.startswith(said) for note in linked] == [True] * (not also)


def test_what_nothing_explains_is_stated_with_the_terms_at_their_bounds() -> None:
    found = _of_negative_terms(damping_n_m_s_rad=-0.05, inertia_kg_m2=-0.002)
    assert found.findings == ()
    ratio = re.search(r"the error on the test runs is (\S+) times the noise", found.notes[0])
    assert float(ratio[1]) > 5.0
    assert found.verdict == "unexplained"
    assert "at a bound: inertia.missing inertia" in found.notes[1]


def test_what_an_inertia_cannot_be_is_an_effect_of_the_acceleration() -> None:
    found = _of_negative_terms(damping_n_m_s_rad=-0.05, inertia_kg_m2=-0.02)
    (finding,) = found.findings
    assert (finding.verdict, finding.depends_on) == ("depends_on", ("acceleration",))
    assert "at a bound: inertia.missing inertia" in found.notes[1]


def _of_negative_terms(damping_n_m_s_rad: float, inertia_kg_m2: float) -> Diagnosis:
    """Return the diagnosis of an axis with negative terms and slow noise; its inertia is .02."""
    random, runs = np.random.default_rng(0), []
    change = inertia_kg_m2 - 0.02
    for run in turning(lambda _, speed, acc: damping_n_m_s_rad * speed + change * acc):
        slow = np.cumsum(random.normal(0, 2e-3, len(run.time_s)))
        torque = run["crank_torque_n_m"] + slow - slow.mean()
        runs.append(run.with_columns(crank_torque_n_m=torque))
    return diagnose(runs, [axis()], split(runs))


@pytest.mark.parametrize(("offset_n_m", "word"), [(0.0, "is noise"), (0.03, "no explanation")])
def test_errors_of_means_count_where_runs_have_no_offsets_of_their_own(
    offset_n_m: float, word: str
) -> None:
    random, runs = np.random.default_rng(0), []
    for run in turning(lambda *_: 0.0):
        torque = run["crank_torque_n_m"] + random.normal(0.0, offset_n_m)
        runs.append(run.with_columns(crank_torque_n_m=torque))
    found = diagnose(runs, [replace(axis(), run_offsets=False)], split(runs))
    assert found.findings == ()
    assert word in found.notes[0]
