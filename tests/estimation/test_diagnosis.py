"""Diagnosis on an analytic rig whose missing effect is known."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from estimation import model_file
from estimation.campaign import Campaign
from estimation.diagnosis.balance import lay_out
from estimation.diagnosis.candidate import pool
from estimation.diagnosis.design import prepare
from estimation.diagnosis.diagnose import diagnose
from estimation.diagnosis.evidence import chance, leave_one_run_out, runs_agree, surrogates
from estimation.diagnosis.gates import Gates
from estimation.diagnosis.limits import limits
from estimation.diagnosis.maps import best_map
from estimation.diagnosis.naming import Named, withdrawn
from estimation.diagnosis.search import Search, Trial
from estimation.diagnosis.split import SplitError, data_hash, split
from estimation.diagnosis.steps import forwards
from estimation.diagnosis.variables import bases, needed_channels
from estimation.diagnosis.wander import steadiness
from estimation.errors import EstimationError
from estimation.fitting import fit
from estimation.recording import Flag, Instrument, Stretch
from tests.estimation import synthetic

pytestmark = pytest.mark.long

MOTOR = model_file.read(Path("motor"))
QUICK = Gates(surrogates=99)


def runs(extra=None, count=12, seconds=6.0, first_seed=0):
    random = np.random.default_rng(first_seed)
    return [
        synthetic.run(
            f"run{k:02d}",
            0.2 + 0.15 * (k % 3),
            0.05 * (1 + k // 3),
            seed=first_seed + k,
            seconds=seconds,
            offset_n_m=0.02 + 0.005 * random.normal(),
            extra=extra,
        )
        for k in range(count)
    ]


def spring(motor_rad, speed_rad_s, load_n_m):
    return 0.02 * motor_rad / 35


def tight_spot(motor_rad, speed_rad_s, load_n_m):
    return 0.01 * np.exp(-(((motor_rad / 35 - 0.2) / 0.1) ** 2)) * np.tanh(speed_rad_s / 3)


def diagnosed(recordings, **options):
    sealed = split(recordings, 1)
    return diagnose(recordings, [MOTOR], sealed, gates=QUICK, **options)


def test_a_missing_effect_of_the_catalogue_is_named_and_confirmed():
    diagnosis, stories = diagnosed(runs(spring))
    (finding,) = diagnosis.findings
    assert (finding.family, finding.verdict) == ("spring.position", "identified")
    assert finding.rmse_after < 0.2 * finding.rmse_before
    assert finding.runs_improved == finding.runs_total == 4
    stiffness = finding.parameters["stiffness"]
    low, high = stiffness.ci95
    # a spring takes from the target of this balance, so its stiffness is positive on that side
    assert stiffness.value == pytest.approx(0.02, rel=0.05)
    assert low <= stiffness.value <= high
    assert stiffness.unit == "N m/rad"
    fitted = stories["motor"].model
    assert fitted.is_fitted
    assert "spring.position" in {term.effect.id for term in fitted.terms}
    assert model_file.parse(model_file.to_toml(fitted)) == fitted
    assert not any("stands alone" in note for note in diagnosis.notes)
    alike = {"motor": replace(stories["motor"], own_share=0.004)}
    (note,) = (n for n in limits(diagnosis.sealed, None, alike, QUICK) if "stands alone" in n)
    assert "motor_current_a only 0.4% is its own" in note
    assert "rig record --protocol diagnosis" in note


def uneven_ripple(motor_rad, speed_rad_s, load_n_m):
    return 0.006 * np.sin(3 * motor_rad) + 0.002 * np.cos(4 * motor_rad)


def test_a_formula_stands_beside_a_name_for_what_its_equation_leaves_of_its_own_cause():
    diagnosis, stories = diagnosed(runs(uneven_ripple))
    (finding,) = diagnosis.findings
    assert (finding.family, finding.verdict) == ("ripple.motor", "identified")
    assert finding.parameters["order"].value == pytest.approx(3.0, abs=0.01)
    assert finding.rmse_after < 1.1e-3  # the sensor's noise is 1 mN m; the rest of the wave 1.4
    fitted = stories["motor"].model
    written = [t for t in fitted.terms if t.effect.family == "unknown"]
    assert written
    for term in written:  # the formula that is told has the numbers of the one that is written
        assert f"{term.values['amplitude'].value:.3g} " in finding.form
    assert "motor_angle" in finding.form
    assert model_file.parse(model_file.to_toml(fitted)) == fitted


MEASURED = ("motor_angle_rad", "motor_current_a", "spindle_angle_rad", "proximal_torque_n_m")

MASKED = np.array([[1.0, 0.0, 0.7], [0.0, 1.0, 0.7], [0.0, 0.0, 0.3]])
"""Three independent columns to two effects and a third that has a little of both."""


def spring_and_ripple(motor_rad, speed_rad_s, load_n_m):
    return spring(motor_rad, speed_rad_s, load_n_m) + 0.0025 * np.sin(3 * motor_rad)


def test_a_small_second_cause_is_told_where_it_is_most_of_what_the_first_leaves():
    diagnosis, _ = diagnosed(runs(spring_and_ripple))
    assert {f.family for f in diagnosis.findings} == {"spring.position", "ripple.motor"}
    assert {f.verdict for f in diagnosis.findings} == {"identified"}


@pytest.mark.parametrize(
    ("together", "first"),
    [
        (0.6, "friction.viscous_asymmetry + spring.position"),
        (0.0, "friction.drag"),  # what misleads a search by single steps
    ],
)
def test_two_effects_that_mask_one_another_are_found_together(together, first):
    recordings = runs(count=8)
    names = ("friction.viscous_asymmetry", "spring.position", "friction.drag")
    offered = [
        next(c for c in pool(MOTOR, sorted(recordings[0].columns)) if c.id == name)
        for name in names
    ]
    wanted = [MOTOR.target, *MOTOR.channels, *(name for c in offered for _, name in c.channels)]
    made = [prepare(recording, list(dict.fromkeys(wanted)), MOTOR) for recording in recordings]
    balance = lay_out(fit(MOTOR, Campaign.of(recordings), bootstrap=0), made)
    random = np.random.default_rng(0)
    columns = [random.normal(size=(len(y), 3)) @ MASKED for y in balance.target]
    target = [
        y + 0.01 * c[:, 0] + 0.01 * c[:, 1] for y, c in zip(balance.target, columns, strict=True)
    ]
    tables_of = {c: [block[:, [k]] for block in columns] for k, c in enumerate(offered)}
    balance = replace(balance, target=target, tables_of=tables_of)
    search = Search(balance, offered, replace(QUICK, together=together))
    search.table = columns
    assert forwards(search).trials[0].family == first


def test_a_name_falls_with_the_one_it_stood_beside_where_the_map_leaves_it_nothing():
    recordings = runs(spring_and_ripple, count=8)
    wanted = list(
        dict.fromkeys([MOTOR.target, *MOTOR.channels, *needed_channels("motor", MEASURED)])
    )
    made = [prepare(recording, list(dict.fromkeys(wanted)), MOTOR) for recording in recordings]
    balance = lay_out(fit(MOTOR, Campaign.of(recordings), bootstrap=0), made)
    search = Search(balance, [], QUICK)
    flat = best_map(balance, balance.terms, 0, 0, only={"spindle_angle"})
    kinds = {c.id: c for c in pool(MOTOR, MEASURED) if c.id != "ripple.motor" or c.shape == (3.0,)}
    names = ("friction.drag", "spring.position", "ripple.motor")
    trial = Trial((), 0.5, 0.5, np.zeros(8))
    named = [Named(kinds[name], trial, 0.5) for name in names]
    left = withdrawn([replace(named[0], veto=flat), *named[1:]], search)
    assert [n.candidate.family for n in left if n.veto is None] == ["ripple.motor"]
    assert withdrawn(named, search) == named


def test_an_effect_outside_the_catalogue_is_unknown_but_its_variables_are_found():
    diagnosis, stories = diagnosed(runs(tight_spot))
    assert diagnosis.verdict == "depends_on"
    (finding,) = diagnosis.findings
    assert finding.family == "unknown"
    assert set(finding.depends_on) <= {"velocity_sign", "velocity", "spindle_angle"}
    assert "spindle_angle" in finding.depends_on
    assert finding.confidence is None
    assert finding.rmse_after < 0.5 * finding.rmse_before
    # the form it was made by, written as effects that run as any other
    assert 1 <= len(finding.formulas) <= 5
    (best, *others) = finding.formulas
    assert "tanh(velocity" in best.text
    assert best.rmse_after < 1.1 * finding.rmse_after
    assert best.gain > 0.9
    assert all(other.rmse_after is None for other in others)
    fitted = stories["motor"].model
    (spot,) = [term for term in fitted.terms if term.effect.family == "unknown"]
    assert spot.effect.id in ("unknown.sign.bump", "unknown.bump.sign")
    shape = {name.split("_")[1]: known.value for name, known in spot.values.items() if "_" in name}
    role = "second" if spot.effect.id.endswith("bump") else "first"
    assert spot.values[f"{role}_width"].value == pytest.approx(0.1, rel=0.05)
    assert spot.values[f"{role}_width"].value * shape["place"] == pytest.approx(0.2, abs=0.005)
    assert model_file.parse(model_file.to_toml(fitted)) == fitted


def test_a_name_withdrawn_by_a_map_below_its_own_floor_leaves_a_finding():
    recordings = runs(tight_spot, count=9, seconds=4.0)
    gates = replace(QUICK, map_floor=0.999)
    diagnosis, stories = diagnose(recordings, [MOTOR], split(recordings, 1), gates=gates)
    assert any(named.veto is not None for named in stories["motor"].discovery.named)
    (finding,) = diagnosis.findings
    assert (finding.family, finding.verdict) == ("unknown", "depends_on")
    assert "spindle_angle" in finding.depends_on


def test_a_balance_is_never_mapped_over_its_own_target():
    recordings = [
        r.with_columns(jaw_angle_rad=r["spindle_angle_rad"] * 1.1 - r["distal_torque_n_m"])
        for r in runs(count=6, seconds=2.0)
    ]
    stretch = model_file.read(Path("stretch"))
    _, stories = diagnose(recordings, [stretch], split(recordings, 1), gates=QUICK)
    mapped = {basis.variable: basis.channel for basis in bases(stories["stretch"].balance)}
    assert "spindle_angle" in mapped
    assert mapped["jaw_angle"] == "projected_jaw_angle_rad"  # as the declared model estimates it
    assert "jaw_angle_rad" not in mapped.values()


@pytest.mark.parametrize("seed", [100, 200, 300, 400])
def test_nothing_is_found_where_nothing_is_missing(seed):
    diagnosis, _ = diagnosed(runs(first_seed=seed))
    assert diagnosis.verdict == "nothing_missing"
    assert diagnosis.findings == ()
    assert diagnosis.errors["motor"].after == diagnosis.errors["motor"].before


def test_with_too_few_runs_something_is_missing_but_nothing_is_named():
    diagnosis, _ = diagnosed(runs(spring, count=5))
    assert diagnosis.verdict in ("something_missing", "nothing_missing")
    assert all(f.family == "unknown" and not f.alternatives for f in diagnosis.findings)
    assert any("no effect is named" in note for note in diagnosis.notes)


def test_an_executor_gives_the_same_answer():
    recordings = runs(spring, count=9, seconds=4.0)
    alone, _ = diagnosed(recordings)
    with ThreadPoolExecutor(2) as executor:
        together, _ = diagnosed(recordings, executor=executor)
    assert replace(alone, seconds=0.0) == replace(together, seconds=0.0)


def test_twins_with_the_same_artefact_take_the_name_away():
    recordings = runs(spring, count=9, seconds=4.0)

    def maker(model, discover):
        return lambda seed: [
            synthetic.run(
                f"t{k}", 0.2 + 0.1 * k, 0.1, seed=seed * 10 + k, seconds=4.0, extra=spring
            )
            for k in range(6)
        ]

    diagnosis, stories = diagnosed(recordings, twins={"motor": maker})
    assert stories["motor"].discovery.steps[0].p_twin > QUICK.chance
    assert all(f.family == "unknown" for f in diagnosis.findings)


def test_twins_without_it_leave_the_name():
    recordings = runs(spring, count=9, seconds=4.0)

    def maker(model, discover):
        return lambda seed: [
            synthetic.run(f"t{k}", 0.2 + 0.1 * k, 0.1, seed=seed * 10 + k, seconds=4.0)
            for k in range(6)
        ]

    diagnosis, stories = diagnosed(recordings, twins={"motor": maker})
    assert stories["motor"].discovery.steps[0].p_twin < QUICK.chance
    assert diagnosis.findings[0].family == "spring.position"


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
        ends = [
            (min(v), max(v)) for v in ([r.conditions[name] for r in s] for s in (kept, recordings))
        ]
        assert ends[0] == ends[1]


def test_the_data_hash_follows_the_samples():
    one = runs(count=3, seconds=1.0)
    changed = [one[0].with_columns(motor_current_a=one[0]["motor_current_a"] + 1e-12), *one[1:]]
    assert data_hash(one) == data_hash(list(reversed(one)))
    assert data_hash(one) != data_hash(changed)


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda r: r[:2], "too few to diagnose"),
        (lambda r: [replace(r[0], rig="another"), *r[1:]], "2 rigs"),
        (lambda r: [replace(r[0], instrument=Instrument(serial="x")), *r[1:]], "2 instruments"),
        (
            lambda r: [
                replace(x, columns={k: v for k, v in x.columns.items() if k != "motor_current_a"})
                for x in r
            ],
            "motor_current_a",
        ),
        (
            lambda r: [
                x.with_columns(
                    motor_current_a=np.where(np.arange(len(x)) == 700, np.nan, x["motor_current_a"])
                )
                for x in r
            ],
            "not finite",
        ),
        (
            lambda r: [
                x.with_columns(motor_angle_rad=np.zeros(len(x)), motor_current_a=np.ones(len(x)))
                for x in r
            ],
            "No valid samples",
        ),
    ],
    ids=["too few", "two rigs", "two instruments", "no current", "nan", "no excitation"],
)
def test_bad_input_is_told_and_never_named(spoil, message):
    recordings = spoil(runs(spring, count=6, seconds=2.0))
    with pytest.raises((EstimationError, SplitError), match=message):
        diagnosed(recordings)


def test_flagged_stretches_are_left_out():
    def broken(recording):
        wild = recording["proximal_torque_n_m"].copy()
        wild[1500:1700] = 5.0
        stretch = Stretch(1.5, 1.7, Flag.SATURATED, "sensor at its limit")
        return recording.with_columns(proximal_torque_n_m=wild).with_stretch(stretch)

    diagnosis, _ = diagnosed([broken(r) for r in runs(spring)])
    assert diagnosis.findings[0].family == "spring.position"


def test_the_gain_on_runs_left_out_is_that_of_plain_least_squares():
    random = np.random.default_rng(0)
    base = [random.normal(size=(50, 2)) for _ in range(4)]
    block = [random.normal(size=(50, 3)) for _ in range(4)]
    target = [b @ [1.0, 2.0] + c @ [0.5, 0, 0] for b, c in zip(base, block, strict=True)]
    target = [y + 0.3 * random.normal(size=50) for y in target]
    losses = leave_one_run_out(base, block, [1, 2], [y[:, None] for y in target])
    for k, columns in enumerate([[0], [1, 2]]):
        for r in range(4):
            wide = [np.hstack([b, c[:, columns]]) for b, c in zip(base, block, strict=True)]
            others = [j for j in range(4) if j != r]
            weights = np.linalg.lstsq(
                np.vstack([wide[j] for j in others]),
                np.concatenate([target[j] for j in others]),
                rcond=None,
            )[0]
            left = target[r] - wide[r] @ weights
            assert losses.joint[r, k, 0] == pytest.approx(left @ left, rel=1e-6)
    assert losses.gain[0, 0] > 0.5 > losses.gain[1, 0]


def test_a_run_that_alone_tells_a_declared_parameter_counts_alike_with_and_without_a_block():
    random = np.random.default_rng(1)
    base = [random.normal(size=(50, 2)) * [1.0, size] for size in (1.0, 0.01, 0.01, 0.01)]
    block = [random.normal(size=(50, 1)) for _ in range(4)]
    target = [c[:, 0] + 0.3 * random.normal(size=50) for c in block]
    losses = leave_one_run_out(base, block, [1], [y[:, None] for y in target])
    assert losses.joint[0, 0, 0] == losses.base[0, 0] == pytest.approx(target[0] @ target[0])
    assert np.all(losses.joint[1:, 0, 0] < 0.5 * losses.base[1:, 0])


def test_surrogates_keep_the_power_and_lose_the_place():
    left = [np.sin(np.arange(400) / (10 + k)) for k in range(5)]
    drawn = surrogates(left, 50, seed=3)
    for one, made in zip(left, drawn, strict=True):
        assert made.shape == (400, 50)
        assert np.abs(made.mean(axis=0)).max() < 1e-12
        assert abs(np.mean(made.T @ one) / (one @ one)) < 0.3


def test_chance_is_never_zero_and_agreement_needs_five_runs():
    assert chance(1.0, np.zeros(99)) == 0.01
    assert chance(0.0, np.zeros(99)) == 1.0
    assert runs_agree(np.ones(5), np.full(5, 0.5) + 0.01 * np.arange(5)) <= 0.05
    assert runs_agree(np.ones(4), np.full(4, 0.5) + 0.01 * np.arange(4)) > 0.05
    assert runs_agree(np.ones(5), np.ones(5)) == 1.0


@pytest.mark.parametrize(("walk_n_m", "is_fault"), [(0.0, True), (1.8e-3, False)])
def test_a_zero_that_wanders_is_no_drift_whatever_its_mean_over_the_runs(walk_n_m, is_fault):
    random = np.random.default_rng(4)
    recordings = []
    for run in runs(count=10):
        slope_n_m_s = (3e-3 + walk_n_m * random.normal()) / 6.0
        drifting = run["proximal_torque_n_m"] + slope_n_m_s * run["time_s"]
        recordings.append(run.with_columns(proximal_torque_n_m=drifting))
    wanted = [MOTOR.target, *MOTOR.channels, *needed_channels("motor", MEASURED), "time_s"]
    made = [prepare(recording, list(dict.fromkeys(wanted)), MOTOR) for recording in recordings]
    balance = lay_out(fit(MOTOR, Campaign.of(recordings), bootstrap=0), made)
    drift = next(c for c in pool(MOTOR, MEASURED) if c.id == "sensor.drift")
    search = Search(balance, [drift], QUICK)
    (trial,) = search.ranked([], QUICK.draws)
    assert trial.passes(QUICK)  # its mean is no chance, in either case
    assert search.is_of_noise(trial, []) is not is_fault


def test_what_moves_with_more_than_time_is_not_asked_whether_it_wanders():
    recordings = runs(spring, count=8)
    wanted = [MOTOR.target, *MOTOR.channels, *needed_channels("motor", MEASURED)]
    made = [prepare(recording, list(dict.fromkeys(wanted)), MOTOR) for recording in recordings]
    balance = lay_out(fit(MOTOR, Campaign.of(recordings), bootstrap=0), made)
    kinds = {c.id: c for c in pool(MOTOR, MEASURED)}
    assert steadiness(balance, balance.terms, [kinds["spring.position"]]) is None
