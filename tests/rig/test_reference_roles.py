"""Which effects may be added to an equation of the reference rig, and which channels they read."""

from estimation.effects import effect
from rig.simulation.reference_roles import candidates

CHANNELS = ("motor_current_a", "motor_angle_rad", "spindle_angle_rad")


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
