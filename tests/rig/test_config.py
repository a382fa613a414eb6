"""The configuration: every key checked, the nearest one named."""

import pytest

from rig.config import SIMULATED, load_config
from rig.errors import UsageError


def test_the_simulated_rig_is_the_default():
    config = load_config()
    assert config.is_simulated
    assert config.calibration_set().name == "reference"


def test_a_section_can_be_changed_without_touching_the_original():
    config = load_config()
    changed = config.changed(simulation={"seed": 7}, name="other")
    assert (changed.simulation.seed, changed.name) == (7, "other")
    assert config.simulation.seed == 0
    assert changed.controller == config.controller


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("kp =", "kpp =", r"kpp: there is no such key; did you mean 'kp'"),
        ("motor_current_a = 0.6", "motor_current_a = -0.6", "greater than 0"),
        ('name = "simulated rig"', "", "name: Field required"),
        ("lever_arm_m = 0.012", "lever_arm_m = inf", "finite"),
    ],
)
def test_a_wrong_key_is_named(tmp_path, old, new, message):
    text = SIMULATED.read_text()
    assert old in text
    path = tmp_path / "rig.toml"
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(UsageError, match=message):
        load_config(path)


def test_a_file_that_is_not_there_is_a_usage_error(tmp_path):
    with pytest.raises(UsageError, match="cannot be read"):
        load_config(tmp_path / "absent.toml")
