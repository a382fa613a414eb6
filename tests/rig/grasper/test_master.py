"""The master's potentiometers: counts to joints, by the configuration, and what they refuse."""

from pathlib import Path

import numpy as np
import pytest

from rig.configuration.config import SHIPPED, load_config
from rig.errors import UsageError
from rig.grasper.coupling import GrasperError
from rig.grasper.settings import master_section


def configured(**master):
    return load_config(Path("grasper")).changed(machine={"master": master})


def test_zero_and_turn_of_each_potentiometer_are_the_configurations():
    chief = master_section(
        configured(zero_counts=(2000, 2048, 2100), rad_per_count=(1e-3, -1e-3, 2e-3))
    )
    np.testing.assert_allclose(chief.joint_rad([2100, 2148, 2000]), [0.1, -0.1, -0.2])


def test_a_turn_of_300_degrees_is_the_default():
    assert np.degrees(master_section(configured()).joint_rad([4094, 2048, 1])).tolist() == (
        pytest.approx([149.89, 0.0, -149.96], abs=0.01)
    )


@pytest.mark.parametrize("counts", [[0, 2048, 2048], [2048, 4095, 2048], [2048, 2048, np.nan]])
def test_a_potentiometer_at_its_rail_commands_nothing(counts):
    with pytest.raises(GrasperError, match="rail"):
        master_section(configured()).joint_rad(counts)


@pytest.mark.parametrize("turn", ["0", "nan", "1.0"])
def test_a_potentiometer_that_shows_nothing_is_refused(turn, tmp_path):
    path = tmp_path / "rig.toml"
    shipped = (SHIPPED / "grasper.toml").read_text()
    path.write_text(f"{shipped}\n[machine.master]\nrad_per_count = [1e-3, {turn}, 1e-3]\n")
    with pytest.raises(UsageError, match="rad_per_count"):
        load_config(path)
