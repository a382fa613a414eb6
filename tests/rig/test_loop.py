"""`rig loop --sim`: rounds until the name is unique, partly with a stand-in for the diagnosis."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from estimation.diagnosis.result import Diagnosis, Finding
from estimation.diagnosis.split import Sealed
from rig.configuration.config import load_config
from rig.diagnosis import loop as looping
from rig.diagnosis.loop import NO_RIVALS, NOTHING, SPENT, UNIQUE, Budget, run_loop
from rig.errors import UsageError
from rig.protocols.protocol import load_protocol, protocol_toml
from rig.simulation.hidden import NAMES, UnknownHiddenEffectError, chosen
from tests.rig.rippled import PROTOCOL
from tests.rig.simulated import short_protocol, simulated

pytestmark = pytest.mark.long

NEXT = {
    "name": "small",
    "protocol": short_protocol(2).model_dump(exclude_unset=True) | {"name": "small"},
}


def answer(verdict: str, proposed=None) -> Diagnosis:
    finding = Finding(balance="motor", error_of="motor", family="friction.load", verdict=verdict)
    return Diagnosis(
        (finding,), {}, {}, {}, {}, Sealed((), (), 0, "", ""), next_experiment=proposed
    )


@pytest.fixture
def diagnosed(monkeypatch):
    """What the diagnoses say, one a round, and the names of the runs each was given."""
    told = SimpleNamespace(answers=[], seen=[])

    def stand_in(asked, ledger, **_):
        told.seen.append(asked.campaign.names)
        return SimpleNamespace(diagnosis=told.answers[len(told.seen) - 1]), {}

    monkeypatch.setattr(looping, "run_diagnosis", stand_in)
    return told


def rounds(folder, budget=Budget(5, 60.0), **options):  # noqa: B008 - frozen
    first = short_protocol(2)
    return list(run_loop(folder, simulated(seed=1), [], budget, first=first, **options))


def test_rivals_are_distinguished_by_a_second_campaign_read_with_the_first(tmp_path, diagnosed):
    diagnosed.answers = [answer("one_of", NEXT), answer("identified")]
    made = rounds(tmp_path)
    assert [r.stopped for r in made] == ["", UNIQUE]
    assert [r.experiment for r in made] == ["short", "small"]
    assert [len(names) for names in diagnosed.seen] == [2, 4]
    assert {name.split("/")[0] for name in diagnosed.seen[1]} == {"round-1", "round-2"}
    kept = load_protocol(str(tmp_path / "round-2.protocol.toml"))
    assert kept.name == "small"


@pytest.mark.parametrize(
    ("first", "why"),
    [
        (answer("identified"), UNIQUE),
        (replace(answer("identified"), findings=()), NOTHING),
        (answer("depends_on"), NO_RIVALS),
        (answer("one_of", {"name": "by hand", "protocol": None}), NO_RIVALS),
    ],
)
def test_a_loop_ends_where_nothing_more_can_be_distinguished(tmp_path, diagnosed, first, why):
    diagnosed.answers = [first]
    assert [r.stopped for r in rounds(tmp_path)] == [why]


def test_a_loop_ends_with_its_budget(tmp_path, diagnosed):
    diagnosed.answers = [answer("one_of", NEXT)] * 3
    assert [r.stopped for r in rounds(tmp_path / "a", Budget(2, 60.0))] == ["", SPENT]
    ticks = iter([0.0, 100.0])
    diagnosed.seen.clear()
    made = rounds(tmp_path / "b", Budget(5, 1.0), clock=lambda: next(ticks))
    assert [r.stopped for r in made] == [SPENT]


def test_a_real_rig_a_full_folder_and_an_empty_budget_are_refused(tmp_path):
    real = load_config().changed(logger={"url": "socket://nowhere:1"})
    with pytest.raises(UsageError, match="real rig"):
        list(run_loop(tmp_path, real, [], Budget(3, 20.0)))
    (tmp_path / "there").write_text("")
    with pytest.raises(UsageError, match="not empty"):
        list(run_loop(tmp_path, simulated(), [], Budget(3, 20.0)))
    with pytest.raises(UsageError, match="allows nothing"):
        Budget(0, 20.0)


def test_what_is_hidden_is_chosen_by_name_by_seed_or_not_at_all():
    assert chosen(["motor_ripple", "jaw_mass=0.5"], 0) == {"motor_ripple": 1.0, "jaw_mass": 0.5}
    assert chosen(["none"], 0) == {}
    (drawn,) = chosen(None, 3)
    assert drawn in NAMES
    assert chosen(None, 3) == chosen(None, 3)
    with pytest.raises(UnknownHiddenEffectError):
        chosen(["motor_riple"], 0)
    with pytest.raises(UnknownHiddenEffectError):
        chosen(["motor_ripple=much"], 0)


def test_the_whole_loop_names_what_is_hidden(tmp_path, answered):
    protocol = tmp_path / "first.toml"
    protocol.write_text(protocol_toml(PROTOCOL))
    words = "loop --sim --hide motor_ripple=1.0 --equation motor --quick --seed 1 --rounds 1"
    said = answered(words, "--protocol", protocol, "--out", tmp_path / "loop")
    assert said["hidden"] == {"motor_ripple": 1.0}
    (only,) = said["rounds"]
    assert only["diagnosis"]["findings"][0]["family"] == "ripple.motor"
    assert (tmp_path / "loop" / "round-1" / "diagnosis.html").exists()
