"""Noise floor and next experiment from logs of the simulated rig."""

import json
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace

import pytest

from estimation.causes.equations import on_one_clock
from estimation.causes.verdict import Answer, answer
from estimation.diagnosis.split import split
from estimation.recording import Recording
from rig.configuration.config import load_config
from rig.diagnosis.menu import menu, room_of, within
from rig.diagnosis.noise import noise_floors, repeats
from rig.diagnosis.propose import propose, write_protocol
from rig.diagnosis.simulated import simulated_rig
from rig.protocols.protocol import load_protocol, protocol_toml
from rig.simulation.fitted_rig import FittedRig
from rig.simulation.hidden import HiddenEffect
from tests.rig.rippled import MOTOR, record

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def rippled() -> list[Recording]:
    return on_one_clock(record(HiddenEffect("motor_ripple", 1.0)))


@pytest.fixture(scope="module")
def answered(rippled: list[Recording]) -> Answer:
    return answer(rippled, [MOTOR], split(rippled, 0))


@pytest.fixture(scope="module")
def doubtful(answered: Answer) -> Answer:
    """The same answer with the first finding less sure than it is."""
    first = replace(answered.diagnosis.findings[0], verdict="one_of", confidence=0.5)
    diagnosis = replace(answered.diagnosis, findings=(first, *answered.diagnosis.findings[1:]))
    return replace(answered, diagnosis=diagnosis)


@pytest.fixture(scope="module")
def rig(answered: Answer, rippled: list[Recording]) -> FittedRig:
    fitted = [e.model for e in answered.layout.equations.values()]
    made = simulated_rig(fitted, rippled)
    assert made is not None
    return made


def test_a_sure_name_needs_no_experiment(answered: Answer, rippled: list[Recording]) -> None:
    assert answered.diagnosis.findings[0].family == "ripple.motor"
    assert answered.diagnosis.verdict == "identified"
    assert propose(answered, rippled) is None


def test_runs_without_the_rigs_channels_cannot_be_simulated(
    answered: Answer, rippled: list[Recording]
) -> None:
    bare = [
        replace(r, columns={n: v for n, v in r.columns.items() if n != "load_command_a"})
        for r in rippled
    ]
    assert simulated_rig([e.model for e in answered.layout.equations.values()], bare) is None


def test_repeats_are_found_by_what_was_asked(rippled: list[Recording]) -> None:
    names = [r.name for r in rippled]
    assert repeats(rippled) == [
        (names[6], names[7]),
        (names[6], names[8]),
        (names[7], names[8]),
    ]


def test_the_noise_floor_is_below_the_error_that_remains(
    answered: Answer, rippled: list[Recording]
) -> None:
    floor = noise_floors(answered.refits, rippled)["motor"]
    assert floor is not None
    assert 0.3 * answered.diagnosis.errors["motor"].after < floor
    assert floor < 1.2 * answered.diagnosis.errors["motor"].after


def test_every_experiment_of_the_menu_is_a_protocol_within_the_limits(
    rippled: list[Recording], rig: FittedRig, tmp_path
) -> None:
    limits = load_config().limits
    offered = menu(room_of(rippled, limits))
    assert len({protocol.name for protocol in offered}) == len(offered) >= 8
    for protocol in offered:
        path = tmp_path / f"{protocol.name}.toml"
        path.write_text(protocol_toml(protocol))
        again = load_protocol(str(path))
        assert [p.name for p in again.plans()] == [p.name for p in protocol.plans()]
        assert len(protocol.plans()) >= 3  # some train, one tests
        first = rig.play(protocol.plans()[0], 1)
        assert within([first], limits), protocol.name


def test_a_limit_keeps_an_experiment_away(rippled: list[Recording]) -> None:
    tight = load_config().limits.model_copy(update={"motor_current_a": 1e-3})
    assert not within(rippled[:1], tight)


def test_a_set_gets_an_experiment_that_record_can_run(
    rippled: list[Recording], doubtful: Answer, tmp_path
) -> None:
    proposed = propose(doubtful, rippled)
    assert proposed is not None
    assert proposed["between"][0] == "ripple.motor"
    assert len(set(proposed["between"])) == len(proposed["between"]) >= 2
    assert proposed["discrimination"] > max(0.0, *proposed["others"].values()) - 0.1
    json.dumps(proposed, allow_nan=False)
    path = tmp_path / "next.toml"
    diagnosis = replace(doubtful.diagnosis, next_experiment=proposed)
    assert f"rig record --protocol {path}" in write_protocol(diagnosis, path)
    assert load_protocol(str(path)).plans()


def test_without_a_simulated_rig_the_experiment_is_described(
    rippled: list[Recording], doubtful: Answer, tmp_path
) -> None:
    bare = [
        replace(r, columns={n: v for n, v in r.columns.items() if n != "load_command_a"})
        for r in rippled
    ]
    by_hand = propose(doubtful, bare)
    assert by_hand is not None
    assert by_hand["protocol"] is None
    assert by_hand["description"]
    diagnosis = replace(doubtful.diagnosis, next_experiment=by_hand)
    assert "by hand" in write_protocol(diagnosis, tmp_path / "no.toml")
    assert not (tmp_path / "no.toml").exists()


def test_processes_propose_the_experiment_of_one(
    rippled: list[Recording], doubtful: Answer
) -> None:
    with ProcessPoolExecutor(2) as executor:
        assert propose(doubtful, rippled, executor) == propose(doubtful, rippled)
