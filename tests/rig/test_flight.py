"""The flight recorder: a simulated log is made again by the compiled core, bit for bit."""

from pathlib import Path

import pytest

from rig.bench.logger import open_logger
from rig.bench.session import Session
from rig.configuration.config import Config, load_config
from rig.errors import DataError, SafetyTripError, UsageError
from rig.log.reader import read_log
from rig.log.streams import FLIGHT
from rig.protocols.protocol import Protocol
from rig.recording.campaign import record_campaign
from rig.recording.core_replay import replay_core

pytestmark = pytest.mark.integration

SHORT = {"kind": "sine", "frequencies_hz": [1.0], "loads_a": [0.0, 0.0], "duration_s": 1.0}
LOADED = {"kind": "load_staircase", "frequencies_hz": [1.0], "loads_a": [0.0, 0.8], "hold_s": 2.0}


def recorded(folder: Path, config: Config, runs: dict = SHORT) -> list[Path]:
    plans = Protocol.model_validate({"name": "short", "runs": [runs]}).any_plans()
    with Session(config, open_logger(config)) as session:
        return [result.path for result in record_campaign(session, plans, folder)]


@pytest.mark.parametrize("seed", [0, 1])
def test_every_run_is_made_again_bit_for_bit(tmp_path, seed, said):
    config = load_config(Path("simulated")).changed(simulation={"seed": seed, "spread": 0.1})
    for path in recorded(tmp_path, config):
        found = replay_core(path)
        assert found.passed, found.first_difference
        assert found.samples == 1000
        assert found.is_same_core
        assert "1000 of 1000 samples are the same" in said("replay --core", path).out


def test_a_run_that_tripped_is_made_again_with_its_trip(tmp_path):
    config = load_config(Path("simulated")).changed(
        safety={"continuous_current_a": 0.1, "heat_a2_s": 0.02}
    )
    with pytest.raises(SafetyTripError, match="too high for too long"):
        recorded(tmp_path, config, LOADED)
    (path,) = tmp_path.glob("*.mcap*")
    found = replay_core(path)
    assert found.passed, found.first_difference
    assert found.trips == ("overheated",)


def test_another_plant_does_not_pass_and_hidden_effects_are_given_to_a_replay(tmp_path):
    config = load_config(Path("simulated")).changed(simulation={"hidden": {"motor_ripple": 1.0}})
    path = recorded(tmp_path, config)[0]
    assert replay_core(path, config).passed
    for other in (None, config.changed(simulation={"seed": 7})):  # a log holds no hidden effect
        found = replay_core(path, other)
        assert not found.passed
        assert "in the log" in found.first_difference
        assert found.same < found.samples


def test_what_cannot_be_made_again_is_refused_in_words(tmp_path):
    path = recorded(tmp_path, load_config(Path("simulated")))[0]
    with pytest.raises(UsageError, match="real shaft"):
        replay_core(path, load_config(Path("reference")))
    sensor = tmp_path / "sensor"
    config = load_config(Path("dynamixel_simulated"))
    sensor.mkdir()
    other = recorded(sensor, config)[0]
    assert FLIGHT not in read_log(other).topics
    with pytest.raises(DataError, match="no commands"):
        replay_core(other)
