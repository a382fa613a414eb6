"""MATLAB files: names that are channels, structs that are runs."""

from pathlib import Path

import numpy as np
import pytest
import scipy.io.matlab
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.io import loadmat, savemat

from rig.errors import DataError
from rig.importers.mat5 import read_mat5
from rig.importers.matlab import IMPORTER
from tests.rig.importers.conftest import agree

N = 50
TIME = np.arange(N) / 1000
CURRENT = np.linspace(0, 0.3, N)


@pytest.fixture
def save(tmp_path):
    def _save(variables, name="run.mat", **options):
        path = tmp_path / name
        savemat(path, variables, **options)
        return path

    return _save


@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize("as_column", ["row", "column"])
def test_vectors_are_channels_scalars_conditions_text_notes(save, compressed, as_column):
    path = save(
        {
            "time_s": TIME,
            "motor_current_a": CURRENT,
            "finger_force_n": np.arange(N, dtype=np.int16),  # not registered, but it has a unit
            "load_command_a": 0.4,
            "notes": "a quiet morning",
            "grasper": "Maryland",
        },
        do_compression=compressed,
        oned_as=as_column,
    )
    (recording,) = IMPORTER.open(path)
    assert recording.name == "run"
    np.testing.assert_array_equal(recording.time_s, TIME)
    np.testing.assert_array_equal(recording["motor_current_a"], CURRENT)
    assert recording["finger_force_n"].dtype == np.float64
    assert set(recording.columns) == {"motor_current_a", "finger_force_n"}
    assert dict(recording.conditions) == {"load_command_a": 0.4, "grasper": "Maryland"}
    assert recording.notes == "a quiet morning"


def test_each_struct_is_a_run(save):
    run = {"time_s": TIME, "motor_current_a": CURRENT}
    campaign = IMPORTER.open(save({"first": run, "second": {**run, "load_command_a": 0.1}}))
    assert campaign.names == ("run/first", "run/second")
    first, second = campaign
    assert first.source.endswith("run.mat:first")
    assert second.conditions["load_command_a"] == 0.1
    np.testing.assert_array_equal(first["motor_current_a"], CURRENT)


@pytest.mark.parametrize(
    ("variables", "message"),
    [
        ({"t": TIME, "i": CURRENT}, r"not understood: t, i.*Found: t \(50,\), i \(50,\).*time_s"),
        ({"motor_current_a": CURRENT}, r"Found: motor_current_a.*Expected time_s"),
        ({"time_s": TIME, "current": CURRENT}, r"not understood: current"),
        ({"time_s": TIME, "motor_current_a": CURRENT[:9]}, r"not understood: motor_current_a"),
        ({"time_s": TIME, "torque_n_m": np.ones((N, 2))}, r"torque_n_m \(50, 2\)"),
        ({"time_s": TIME, "motor_current_a": CURRENT * 1j}, r"not understood: motor_current_a"),
        ({"time_s": TIME, "a_a": {"b": 1.0}}, r"a_a \(struct of b\)"),
        ({"run": {"time_s": TIME}, "x": CURRENT}, r"not understood: x"),
        ({"run": {"time_s": TIME, "x": CURRENT}}, r"not understood: x"),
        (
            {"time_s": TIME, "a_a": np.where(TIME > 0.02, np.nan, 0)},
            r"a_a is not finite at sample 22",
        ),
        ({}, "Found: nothing"),
    ],
)
def test_names_that_cannot_be_understood_are_listed(save, variables, message):
    with pytest.raises(DataError, match=message) as error:
        IMPORTER.open(save(variables))
    assert "run.mat" in error.value.what


def test_a_folder_of_other_files_is_not_claimed(save, tmp_path):
    save({"time_s": TIME, "motor_current_a": CURRENT})
    assert IMPORTER.recognises(tmp_path)
    (tmp_path / "00.TXT").write_text("%")
    assert not IMPORTER.recognises(tmp_path)
    assert IMPORTER.open(tmp_path).names == ("run",)


@settings(
    max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(where=st.floats(0, 1), junk=st.binary(max_size=8), cut=st.booleans())
def test_damaged_files_read_or_raise(save, where, junk, cut):
    path = save({"time_s": TIME, "motor_current_a": CURRENT})
    content = path.read_bytes()
    at = round(where * len(content))
    path.write_bytes(content[:at] + junk + (b"" if cut else content[at + len(junk) :]))
    try:
        for recording in IMPORTER.open(path):
            assert len(recording) == recording.time_s.size
    except DataError:
        return


WRITTEN_BY_MATLAB = [
    path
    for name in ("double", "matrix", "3dmatrix", "minus", "multi", "string", "unicode", "struct*")
    for version in ("6.1_SOL2", "6.5.1_GLNX86", "7.1_GLNX86", "7.4_GLNX86")
    for path in Path(scipy.io.matlab.__path__[0]).glob(f"tests/data/test{name}_{version}.mat")
]


@pytest.mark.skipif(not WRITTEN_BY_MATLAB, reason="SciPy is installed without its test data")
def test_files_matlab_wrote_read_as_scipy_reads_them():
    assert len(WRITTEN_BY_MATLAB) > 20  # big-endian Solaris among them
    for path in WRITTEN_BY_MATLAB:
        ours = read_mat5(path.read_bytes())
        assert ours, path
        assert agree(ours, loadmat(path, simplify_cells=True)), path
