"""Twins, noise floor and next experiment from logs of the simulated rig."""

import json
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace

import pytest

from estimation.diagnosis import diagnose as diagnosing
from estimation.diagnosis.diagnose import diagnose
from estimation.diagnosis.split import split
from estimation.recording import Recording
from rig.configuration.config import load_config
from rig.diagnosis.menu import menu, room_of, within
from rig.diagnosis.noise import repeats
from rig.diagnosis.propose import propose, write_protocol
from rig.diagnosis.twins import REMEMBERED, Remembered, twins_of
from rig.protocols.protocol import load_protocol, protocol_toml
from rig.simulation.hidden import HiddenEffect
from tests.rig.rippled import MOTOR, QUICK, few, record

pytestmark = pytest.mark.long


@pytest.fixture(autouse=True, scope="module")
def _few_effects():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(diagnosing, "pool", few)
        yield


@pytest.fixture(scope="module")
def rippled() -> list[Recording]:
    return record(HiddenEffect("motor_ripple", 0.5))


@pytest.fixture(scope="module")
def answered(rippled):
    """The diagnosis with its twins, in this process."""
    sealed = split(rippled, 0)
    twins = twins_of([MOTOR], [r for r in rippled if r.name in sealed.discover])
    assert [*twins.makers] == ["motor"]
    return (twins, *diagnose(rippled, [MOTOR], sealed, gates=QUICK, twins=twins.makers))


def test_a_name_holds_against_twins_of_the_same_references(rippled, answered) -> None:
    twins, diagnosis, stories = answered
    assert diagnosis.findings[0].family == "ripple.motor"
    assert stories["motor"].discovery.steps[0].p_twin < QUICK.chance
    named = replace(diagnosis.findings[0], verdict="identified", alternatives=())
    assert propose(replace(diagnosis, findings=(named,)), stories, rippled, twins.twin) is None


def test_runs_without_the_rigs_channels_have_no_twin_and_the_reason_is_told(rippled) -> None:
    bare = [
        replace(r, columns={n: v for n, v in r.columns.items() if n != "load_command_a"})
        for r in rippled
    ]
    twins = twins_of([MOTOR], bare)
    assert twins.makers == {}
    assert "load_command_a" in twins.note


def test_repeats_are_found_by_what_was_asked(rippled) -> None:
    names = [r.name for r in rippled]
    assert repeats(rippled) == [
        (names[6], names[7]),
        (names[6], names[8]),
        (names[7], names[8]),
    ]


def test_every_experiment_of_the_menu_is_a_protocol_within_the_limits(rippled, tmp_path) -> None:
    limits = load_config().limits
    offered = menu(room_of(rippled, limits))
    assert len({protocol.name for protocol in offered}) == len(offered) >= 8
    twin = twins_of([MOTOR], rippled).twin
    for protocol in offered:
        path = tmp_path / f"{protocol.name}.toml"
        path.write_text(protocol_toml(protocol))
        again = load_protocol(str(path))
        assert [p.name for p in again.plans()] == [p.name for p in protocol.plans()]
        assert len(protocol.plans()) >= 3  # some discover, one confirms
        first = twin.play(protocol.plans()[0], 1)
        assert within([first], limits), protocol.name


def test_a_limit_keeps_an_experiment_away(rippled) -> None:
    tight = load_config().limits.model_copy(update={"motor_current_a": 1e-3})
    assert not within(rippled[:1], tight)


def test_rivals_get_an_experiment_that_record_can_run(rippled, answered, tmp_path) -> None:
    twins, diagnosis, stories = answered
    # the same answer as if these runs had not told the ripple from one of the current
    first = replace(
        diagnosis.findings[0], verdict="one_of", alternatives=("ripple.current",), confidence=0.5
    )
    doubtful = replace(diagnosis, findings=(first,))
    proposed = propose(doubtful, stories, rippled, twins.twin)
    assert proposed["between"] == ["ripple.motor", "ripple.current"]
    assert proposed["discrimination"] > max(0.0, *proposed["others"].values()) - 0.1
    json.dumps(proposed, allow_nan=False)
    path = tmp_path / "next.toml"
    said = write_protocol(replace(doubtful, next_experiment=proposed), path)
    assert f"rig record --protocol {path}" in said
    assert load_protocol(str(path)).plans()
    by_hand = propose(doubtful, stories, rippled, None)
    assert by_hand["protocol"] is None
    assert by_hand["description"]
    said = write_protocol(replace(doubtful, next_experiment=by_hand), tmp_path / "no.toml")
    assert "by hand" in said
    assert not (tmp_path / "no.toml").exists()


def test_processes_give_the_answer_of_one(rippled, answered) -> None:
    twins, alone, _ = answered
    sealed = split(rippled, 0)
    with ProcessPoolExecutor(2) as executor:
        together, _ = diagnose(
            rippled, [MOTOR], sealed, gates=QUICK, twins=twins.makers, executor=executor
        )
    assert replace(alone, seconds=0.0) == replace(together, seconds=0.0)


def test_a_twin_plays_each_of_its_first_campaigns_once_and_leaves_them_behind_when_sent() -> None:
    asked: list[int] = []

    def twin(seed: int) -> tuple[int, ...]:
        asked.append(seed)
        return (seed,)

    remembered = Remembered(twin)  # type: ignore[arg-type]
    seeds = [0, 1, 0, REMEMBERED, REMEMBERED]
    assert [remembered(seed) for seed in seeds] == [(seed,) for seed in seeds]
    assert asked == [0, 1, REMEMBERED, REMEMBERED]
    kind, parts = remembered.__reduce__()
    assert kind(*parts).played == {}
