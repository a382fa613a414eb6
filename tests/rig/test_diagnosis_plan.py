"""`rig diagnose --plan`: the effects that runs can distinguish, before they are recorded."""

import pytest


@pytest.mark.long
def test_a_protocol_shows_which_effects_its_runs_distinguish(answered):
    plan = answered("diagnose --plan quick --equation motor")
    assert (plan["source"], plan["runs"]) == ("quick", 12)
    chance = {(e["place"], e["family"]): e["probability"] for e in plan["effects"]}
    assert chance["motor", "ripple.motor"] > chance["motor", "hysteresis.bouc_wen"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("quick --machine emps", "recordings of the machine instead"),
        ("no-such-protocol", "no protocol"),
    ],
)
def test_what_cannot_be_played_is_refused(words, message, said):
    assert message in said("diagnose --plan", words, code=2).err
