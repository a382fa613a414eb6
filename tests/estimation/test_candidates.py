"""Which candidates a search is given, and which of them are something else in disguise."""

from dataclasses import replace

import numpy as np
import pytest

from estimation.diagnosis.candidate import Candidate, pool
from estimation.diagnosis.design import Run, covered
from estimation.effects import effect
from estimation.model import Model, Term
from estimation.model_file import ModelFileError, parse, to_toml

CHANNELS = ("motor_current_a", "motor_angle_rad", "spindle_angle_rad")
LINEAR = Model("linear", "motor", "proximal_torque_n_m", (Term(effect("motor.torque_constant")),))


def wave(order: float, kind: str = "ripple.output") -> Candidate:
    term = Term(effect(kind), channels=dict.fromkeys(effect(kind).roles, "spindle_angle_rad"))
    return Candidate.of(term, [order])


def swept(span_rad: float, speed_rad_s: float = 10.0) -> Run:
    channels = {
        "spindle_angle_rad": np.linspace(0.0, span_rad, 100),
        "motor_velocity_rad_s": np.full(100, speed_rad_s),
    }
    every = np.ones(100, bool)
    return Run("swept", channels, every, every, 1)


def test_a_wave_is_only_a_wave_where_a_run_covers_a_period():
    kept = covered([wave(4.0), wave(8.0)], [swept(0.5), swept(1.0)])
    assert [c.shape for c in kept] == [(8.0,)]


@pytest.mark.parametrize("other", ["ripple.output.harmonics", "sensor.encoder_inl"])
def test_a_wave_with_harmonics_or_of_an_encoder_takes_two_periods(other):
    kinds = ("ripple.output", other)
    kept = covered([wave(9.0, kind) for kind in kinds], [swept(1.0)])
    assert [c.id for c in kept] == ["ripple.output"]
    assert len(covered([wave(13.0, kind) for kind in kinds], [swept(1.0)])) == 2


def test_an_effect_without_a_wave_is_always_covered():
    friction = Candidate.of(Term(effect("friction.drag")), [])
    assert covered([friction], [swept(0.1)]) == [friction]


@pytest.mark.parametrize(("width_rad_s", "shown"), [(4.0, True), (6.0, False)])
def test_a_sign_that_turns_round_over_half_of_the_usual_speed_is_none(width_rad_s, shown):
    friction = Candidate.of(Term(effect("friction.position")), [width_rad_s])
    assert bool(covered([friction], [swept(0.1), swept(0.1), swept(0.1, 30.0)])) is shown


@pytest.mark.parametrize(("time_s", "shown"), [(300.0, True), (500.0, False)])
def test_what_fades_more_slowly_than_the_campaign_lasts_is_no_warm_up(time_s, shown):
    warming = Candidate.of(Term(effect("friction.warmup.campaign")), [time_s, 1.0])
    run = swept(0.1)
    late = {**run.channels, "campaign_time_s": np.linspace(380.0, 400.0, 100)}
    assert bool(covered([warming], [replace(run, channels=late)])) is shown


@pytest.mark.parametrize(("place", "limit"), [(0.5, False), (0.8, False), (1.0, True)])
def test_presliding_over_the_longest_way_is_a_spring(place, limit):
    kind = effect("hysteresis.presliding")
    (reach,) = kind.shape
    value = reach.lower ** (1 - place) * reach.upper**place
    assert Candidate.of(Term(kind), [value]).is_limit is limit


def test_what_acts_at_rest_is_searched_where_samples_at_rest_count():
    moving = {c.id for c in pool(LINEAR, CHANNELS)}
    resting = {c.id for c in pool(replace(LINEAR, counted="all"), CHANNELS)}
    assert {i for i in resting if effect(i).at_rest} == resting - moving
    assert "friction.load.sticking" in resting


def test_a_channel_may_play_the_roles_of_another():
    instead = {"motor_current_a": "motor_command_ratio", "motor_load_n_m": "motor_command_ratio"}
    measured = ("motor_command_ratio", "motor_angle_rad", "spindle_angle_rad")
    found = pool(LINEAR, measured, instead)
    assert any(("current", "motor_command_ratio") in c.channels for c in found)
    assert all(name != "motor_current_a" for c in found for _, name in c.channels)


@pytest.mark.parametrize("counted", [None, "all", "motion", "closing"])
def test_a_model_file_says_which_samples_count(counted):
    model = replace(LINEAR, counted=counted)
    assert parse(to_toml(model)).counted == counted


def test_friction_counts_samples_in_motion_unless_the_file_says_otherwise():
    terms = (*LINEAR.terms, Term(effect("friction.coulomb"), -1))
    assert replace(LINEAR, terms=terms).samples == "motion"
    assert LINEAR.samples == "all"
    assert replace(LINEAR, terms=terms, counted="all").samples == "all"


def test_an_unknown_choice_of_samples_names_the_nearest():
    text = to_toml(replace(LINEAR, counted="closing")).replace('"closing"', '"closed"')
    with pytest.raises(ModelFileError, match="closing"):
        parse(text)


@pytest.mark.parametrize(("knee_n_m", "is_play"), [(0.02, True), (0.1, False)])
def test_a_knee_at_no_load_is_play_and_no_stiffening(knee_n_m, is_play):
    bend = Candidate.of(
        Term(effect("transmission.stiffening"), -1, {"load": "proximal_torque_n_m"}), [knee_n_m]
    )
    assert bend.is_limit is is_play


def test_a_campaigns_clock_is_as_long_for_a_warm_up_when_a_drift_reads_it_too():
    warming = Candidate.of(Term(effect("friction.warmup.campaign")), [300.0, 1.0])
    drift = Candidate.of(Term(effect("sensor.drift"), 1, {"elapsed": "campaign_time_s"}), [])
    run = swept(0.1)
    late = {**run.channels, "campaign_time_s": np.linspace(380.0, 400.0, 100)}
    for pool_ in ([warming, drift], [drift, warming]):
        assert warming in covered(pool_, [replace(run, channels=late)])


@pytest.mark.parametrize(("knee_rad_s", "shown"), [(2.0, False), (3.0, True)])
def test_damping_that_is_worn_off_long_before_the_usual_speed_is_a_direction(knee_rad_s, shown):
    film = Candidate.of(Term(effect("friction.load_viscous.saturating")), [knee_rad_s])
    run = swept(0.1)
    loaded = {**run.channels, "motor_load_n_m": np.ones(100)}
    assert bool(covered([film], [replace(run, channels=loaded)])) is shown
