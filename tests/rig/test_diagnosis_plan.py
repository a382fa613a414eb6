"""`rig diagnose --plan`: the effects that runs can distinguish, before they are recorded."""

import json

import pytest

from rig.cli.main import main


@pytest.mark.long
def test_a_protocol_shows_which_effects_its_runs_distinguish(capsys):
    assert main(["diagnose", "--plan", "quick", "--equation", "motor", "--json"]) == 0
    plan = json.loads(capsys.readouterr().out)
    assert (plan["source"], plan["runs"]) == ("quick", 12)
    chance = {(e["place"], e["family"]): e["probability"] for e in plan["effects"]}
    assert chance["motor", "ripple.motor"] > chance["motor", "hysteresis.bouc_wen"]


def test_a_protocol_is_not_played_on_a_machine_that_is_not_simulated(capsys):
    assert main(["diagnose", "--plan", "quick", "--machine", "emps"]) == 2
    assert "recordings of the machine instead" in capsys.readouterr().err


def test_a_protocol_that_does_not_exist_is_refused(capsys):
    assert main(["diagnose", "--plan", "no-such-protocol"]) == 2
    assert "no protocol" in capsys.readouterr().err
