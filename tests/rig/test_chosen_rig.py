"""Which rig a command is about: no command takes the simulated one for granted."""

import os
from pathlib import Path

import pytest

from rig.configuration.config import SIMULATED

CONFIG = SIMULATED.read_text().replace("simulated rig", "bench of Ada")
BROKEN = CONFIG.replace('"sim://"', '"/dev/no-such-board"').replace("bench of Ada", "dead bench")


@pytest.fixture(autouse=True)
def home(newcomer: Path) -> Path:
    """The folder of a person's configurations, without one."""
    folder = Path(os.environ["XDG_CONFIG_HOME"]) / "rig"
    folder.mkdir(parents=True)
    return folder


NEED_A_RIG = [
    "record",
    "live",
    "grip --torque 0.06",
    "calibrate torque --operator Ada --yes",
    "selftest",
    "doctor",
    "stop",
    "clear",
    "reference",
    "config show",
    "config check",
    "cal check",
    "firmware version",
    "grasper follow",
]


@pytest.mark.parametrize("words", NEED_A_RIG)
def test_without_a_rig_a_command_names_the_ways_to_one(words, said):
    printed = said(words, code=2).err
    for way in ("RIG_CONFIG", "./rig.toml", "~/.config/rig/rig.toml", "--config", "--sim"):
        assert way in printed
    assert list(Path().iterdir()) == []


@pytest.mark.parametrize("words", NEED_A_RIG)
def test_sim_and_config_exclude_one_another(words, said):
    if words == "grasper follow":
        pytest.skip("its simulated rig is named by --config grasper")
    other = "reference" if words.startswith("config") else "-c reference"
    assert "Give one of them" in said(words, other, "--sim", code=2).err


def test_the_defaults_have_an_order(home, said, monkeypatch):
    def shown(words=""):
        return said("config show", words).out.splitlines()[0]

    (home / "rig.toml").write_text(CONFIG.replace("of Ada", "of the person"))
    assert shown() == 'name = "bench of the person"'
    Path("rig.toml").write_text(CONFIG.replace("of Ada", "of the folder"))
    assert shown() == 'name = "bench of the folder"'
    monkeypatch.setenv("RIG_CONFIG", "grasper")
    assert shown() == 'name = "simulated grasper"'
    assert shown("--sim") == 'name = "simulated rig"'


@pytest.mark.parametrize("words", ["selftest", "doctor", "stop", "firmware version"])
def test_a_simulated_session_reports_that_it_is_simulated_first(words, said):
    assert said(words, "--sim").err.startswith("Simulated rig")


def test_stop_stops_every_configured_rig_and_goes_on_after_a_dead_one(home, said):
    (home / "a_dead.toml").write_text(BROKEN)
    (home / "b_unreadable.toml").write_text("name =")
    (home / "c.toml").write_text(CONFIG.replace("of Ada", "of the person"))
    Path("rig.toml").write_text(CONFIG)
    out, err = said("stop", code=4)
    assert "bench of Ada: disarmed" in out
    assert "bench of the person: disarmed" in out
    assert "dead bench: UNKNOWN" in err
    assert "b_unreadable.toml: UNKNOWN" in err


def test_stop_without_a_rig_has_stopped_nothing_and_reports_it(said):
    out, err = said("stop", code=2)
    assert "Nothing was stopped" in err
    assert "disarmed" not in out


@pytest.mark.parametrize("words", ["torque", "fsr", "ft"])
def test_a_force_sensor_that_would_be_ignored_is_refused(words, said):
    how = "--operator Ada --yes --sim --force-sensor ati-net=udp:127.0.0.1:49152"
    assert "would not be used" in said("calibrate", words, how, code=2).err
