"""Which effects may be added to an equation, and which samples a model counts."""

from dataclasses import replace

import pytest

from estimation.candidates import candidates
from estimation.effects import effect
from estimation.model import Model, Term
from estimation.model_file import ModelFileError, parse, to_toml

CHANNELS = ("motor_current_a", "motor_angle_rad", "spindle_angle_rad")
LINEAR = Model("linear", "motor", "proximal_torque_n_m", (Term(effect("motor.torque_constant")),))


def test_what_acts_at_rest_is_searched_where_samples_at_rest_count():
    moving = {t.effect.id for t in candidates("motor", CHANNELS)}
    resting = {t.effect.id for t in candidates("motor", CHANNELS, at_rest=True)}
    assert {i for i in resting if effect(i).at_rest} == resting - moving
    assert "friction.load.sticking" in resting


def test_a_channel_may_play_the_roles_of_another():
    instead = {"motor_current_a": "motor_command_ratio", "motor_load_n_m": "motor_command_ratio"}
    measured = ("motor_command_ratio", "motor_angle_rad", "spindle_angle_rad")
    found = [term.channels for term in candidates("motor", measured, instead)]
    assert any(c.get("current") == "motor_command_ratio" for c in found)
    assert all("motor_current_a" not in c.values() for c in found)


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
