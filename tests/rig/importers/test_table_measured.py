"""Machines that other people built: the shipped mappings on their authors' own files."""

import tarfile
from functools import cache
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from rig.importers.derivatives import checked
from rig.importers.table.mapping import read_mapping
from rig.importers.table.open import read_runs
from rig.importers.table.preview import preview

pytestmark = pytest.mark.measured
SHIPPED = Path(str(files("rig"))) / "machines" / "examples"
ARCHIVES = {
    "emps": "emps",
    "smart_grasper": "smart-grasper",
    "sts3215": "sts3215",
    "ur10e": "ur10e",
}


@pytest.fixture(scope="module")
def unpacked(measured_data, tmp_path_factory):
    folder = tmp_path_factory.mktemp("machines")
    for archive in ARCHIVES.values():
        path = measured_data / "machines" / f"machine-{archive}.tar.xz"
        if not path.exists():
            pytest.skip(f"no measured machines at {path}")
        with tarfile.open(path) as content:
            content.extractall(folder, filter="data")
    return folder


@pytest.fixture(scope="module")
def read(unpacked):
    """Return the function that reads a machine's runs, and what is remarked on them."""

    @cache
    def _read(machine):
        remarks = []
        mapping = read_mapping(SHIPPED / f"{machine}.toml", [])
        runs = read_runs(unpacked / ARCHIVES[machine], mapping, remarks)
        return [checked(run) for run in runs], remarks

    return _read


@pytest.mark.parametrize(
    ("machine", "runs", "channel", "range_"),
    [
        ("emps", 8, "carriage_position_m", (0.0, 0.2464)),
        ("smart_grasper", 5, "motor_current_a", (30 * 0.4 / 255, 225 * 0.4 / 255)),
        ("sts3215", 240, "target_angle_rad", (-1.674, 1.674)),
        ("ur10e", 79, "joint_6_angle_rad", (-1.548, 1.573)),
    ],
)
def test_a_shipped_mapping_reads_the_authors_files(read, machine, runs, channel, range_):
    recordings, remarks = read(machine)
    assert len(recordings) == runs
    assert machine != "emps" or preview(recordings, remarks).questions == []
    values = np.concatenate([recording[channel][recording.valid] for recording in recordings])
    np.testing.assert_allclose((values.min(), values.max()), range_, atol=1e-3)


def test_the_drop_outs_of_the_servo_are_flagged_with_the_reason(read):
    recordings, _ = read("sts3215")
    reasons = {stretch.reason for recording in recordings for stretch in recording.stretches}
    assert reasons <= {"the servo did not answer: its reading is -pi", "the drive was switched off"}
    for recording in recordings:
        assert recording["motor_angle_rad"][recording.valid].min() > -3.1
