"""MATLAB files of version 7.3: the same values as in one of version 5."""

import builtins

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from rig.errors import DataError, MissingExtraError
from rig.importers.mat5 import Unread
from rig.importers.mat73 import read_mat73
from rig.importers.matlab import IMPORTER, read_variables
from tests.rig.importers.conftest import agree

TIME = np.arange(50) / 1000
HEAD = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created by: a test".ljust(512)


def save(path, values):
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
        [(TIME, np.array(1.0)), (2 * TIME, np.array(2.0))], dtype=[("t", object), ("m", object)]
    ),
}


def test_every_kind_of_value_is_read_as_from_version_5(tmp_path):
    savemat(tmp_path / "old.mat", VALUES)
    old = read_variables(tmp_path / "old.mat")
    new = read_variables(save(tmp_path / "new.mat", VALUES))
    assert agree(new, old)
    assert agree(old, new)


def test_a_run_is_imported(tmp_path):
    path = save(tmp_path / "run.mat", {"time_s": TIME, "motor_current_a": 2 * TIME})
    (recording,) = IMPORTER.open(path)
    np.testing.assert_array_equal(recording["motor_current_a"], 2 * TIME)


def test_what_is_no_number_is_named_and_what_is_empty_is_empty(tmp_path):
    path = save(tmp_path / "run.mat", {"handle": TIME, "none": TIME, "z": TIME * 1j})
    with h5py.File(path, "r+") as file:
        file["handle"].attrs["MATLAB_class"] = np.bytes_("function_handle")
        file["none"].attrs["MATLAB_empty"] = 1
    values = read_mat73(path)
    assert values["handle"] == Unread("function_handle")
    assert values["z"] == Unread("complex")
    assert values["none"].size == 0


@pytest.mark.parametrize("cut", [0.3, 0.7, 0.99])
def test_a_file_that_is_cut_is_refused(tmp_path, cut):
    path = save(tmp_path / "run.mat", VALUES)
    content = path.read_bytes()
    path.write_bytes(content[: int(cut * len(content))])
    with pytest.raises(DataError, match=r"cannot be read as a MATLAB file of version 7\.3"):
        read_variables(path)


def test_structs_that_hold_themselves_are_refused(tmp_path):
    path = save(tmp_path / "run.mat", {"a": {"t": TIME}})
    with h5py.File(path, "r+") as file:
        file["a/again"] = file["a"]
    with pytest.raises(DataError, match="nested more than"):
        read_variables(path)


def test_without_the_library_the_error_names_the_extra(tmp_path, monkeypatch):
    path = save(tmp_path / "run.mat", {"time_s": TIME})

    def refuse(name, *rest, real=builtins.__import__, **named):
        if name == "h5py":
            raise ModuleNotFoundError("No module named 'h5py'", name="h5py")
        return real(name, *rest, **named)

    monkeypatch.setattr(builtins, "__import__", refuse)
    with pytest.raises(MissingExtraError, match=r"version 7\.3") as error:
        read_variables(path)
    assert error.value.extra == "hdf5"
