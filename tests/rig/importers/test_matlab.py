"""MATLAB files of versions 5 and 7.3: names that are channels, structs that are runs."""

import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io.matlab
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.io import loadmat, savemat

from rig.errors import DataError, MissingExtraError
from rig.importers.mat5 import Unread, read_mat5
from rig.importers.mat73 import read_mat73
from rig.importers.matlab import IMPORTER, read_variables
from tests.rig.importers.conftest import agree

N = 50
TIME = np.arange(N) / 1000
CURRENT = np.linspace(0, 0.3, N)


def save(folder, variables, **options):
    path = folder / "run.mat"
    savemat(path, variables, **options)
    return path


@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize("as_column", ["row", "column"])
def test_vectors_are_channels_scalars_conditions_text_notes(tmp_path, compressed, as_column):
    path = save(
        tmp_path,
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


def test_each_struct_is_a_run(tmp_path):
    run = {"time_s": TIME, "motor_current_a": CURRENT}
    campaign = IMPORTER.open(
        save(tmp_path, {"first": run, "second": {**run, "load_command_a": 0.1}})
    )
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
def test_names_that_cannot_be_understood_are_listed(tmp_path, variables, message):
    with pytest.raises(DataError, match=message) as error:
        IMPORTER.open(save(tmp_path, variables))
    assert "run.mat" in error.value.what


def test_a_folder_of_other_files_is_not_claimed(tmp_path):
    save(tmp_path, {"time_s": TIME, "motor_current_a": CURRENT})
    assert IMPORTER.recognises(tmp_path)
    (tmp_path / "00.TXT").write_text("%")
    assert not IMPORTER.recognises(tmp_path)
    assert IMPORTER.open(tmp_path).names == ("run",)


@settings(max_examples=150)
@given(where=st.floats(0, 1), junk=st.binary(max_size=8), cut=st.booleans())
def test_damaged_files_read_or_raise(tmp_path, where, junk, cut):
    path = save(tmp_path, {"time_s": TIME, "motor_current_a": CURRENT})
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


HEAD = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created by: a test".ljust(512)


def save_73(path, values):
    """Write a file as MATLAB does: dimensions in reverse, cells as references."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, value in values.items():
            _put(file, file, name, value)
    with path.open("r+b") as file:
        file.write(HEAD)
    return path


def _put(file, group, name, value):
    if isinstance(value, dict):
        made = group.create_group(name)
        made.attrs["MATLAB_class"] = np.bytes_("struct")
        for field, inner in value.items():
            _put(file, made, field, inner)
    elif isinstance(value, str):
        codes = np.frombuffer(value.encode("utf-16-le"), "<u2")
        made = group.create_dataset(name, data=codes[:, None])
        made.attrs["MATLAB_class"] = np.bytes_("char")
    elif value.dtype.names:  # an array of structs
        made = group.create_group(name)
        made.attrs["MATLAB_class"] = np.bytes_("struct")
        for field in value.dtype.names:
            made.create_dataset(field, data=_references(file, value[field]))
    elif value.dtype == object:
        made = group.create_dataset(name, data=_references(file, value))
        made.attrs["MATLAB_class"] = np.bytes_("cell")
    else:
        made = group.create_dataset(name, data=np.atleast_2d(value).T)
        made.attrs["MATLAB_class"] = np.bytes_("double")


def _references(file, values):
    store = file.require_group("#refs#")
    found = []
    for value in values.ravel():
        name = str(len(store))
        _put(file, store, name, value)
        found.append(store[name].ref)
    return np.array(found, dtype=h5py.ref_dtype)[:, None]


def objects(*values):
    array = np.empty(len(values), object)
    array[:] = values
    return array


VALUES = {
    "time_s": TIME,
    "matrix": np.arange(6.0).reshape(2, 3),
    "scalar": np.array(0.4),
    "notes": "ein ruhiger Morgen, 20 °C",
    "log": {"q": TIME, "inner": {"z": 2 * TIME}},
    "cells": objects(TIME, np.array([1.0, 2.0])),
    "trial": np.array(
        [(TIME, np.array(1.0)), (2 * TIME, np.array(2.0))],
        dtype=[("t", object), ("m", object)],
    ),
}


def test_every_kind_of_value_is_read_as_from_version_5(tmp_path):
    savemat(tmp_path / "old.mat", VALUES)
    old = read_variables(tmp_path / "old.mat")
    new = read_variables(save_73(tmp_path / "new.mat", VALUES))
    assert agree(new, old)
    assert agree(old, new)


def test_a_run_of_version_73_is_imported(tmp_path):
    path = save_73(tmp_path / "run.mat", {"time_s": TIME, "motor_current_a": 2 * TIME})
    (recording,) = IMPORTER.open(path)
    np.testing.assert_array_equal(recording["motor_current_a"], 2 * TIME)


def test_what_is_no_number_is_named_and_what_is_empty_is_empty(tmp_path):
    path = save_73(tmp_path / "run.mat", {"handle": TIME, "none": TIME, "z": TIME * 1j})
    with h5py.File(path, "r+") as file:
        file["handle"].attrs["MATLAB_class"] = np.bytes_("function_handle")
        file["none"].attrs["MATLAB_empty"] = 1
    values = read_mat73(path)
    assert values["handle"] == Unread("function_handle")
    assert values["z"] == Unread("complex")
    assert values["none"].size == 0


@pytest.mark.parametrize("cut", [0.3, 0.7, 0.99])
def test_a_file_that_is_cut_is_refused(tmp_path, cut):
    path = save_73(tmp_path / "run.mat", VALUES)
    content = path.read_bytes()
    path.write_bytes(content[: int(cut * len(content))])
    with pytest.raises(DataError, match=r"cannot be read as a MATLAB file of version 7\.3"):
        read_variables(path)


def test_structs_that_hold_themselves_are_refused(tmp_path):
    path = save_73(tmp_path / "run.mat", {"a": {"t": TIME}})
    with h5py.File(path, "r+") as file:
        file["a/again"] = file["a"]
    with pytest.raises(DataError, match="nested more than"):
        read_variables(path)


def test_without_the_library_the_error_names_the_extra(tmp_path, monkeypatch):
    path = save_73(tmp_path / "run.mat", {"time_s": TIME})
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(MissingExtraError, match=r"version 7\.3") as error:
        read_variables(path)
    assert error.value.extra == "hdf5"
