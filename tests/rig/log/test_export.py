import csv

import numpy as np
import pyarrow.parquet
import pytest

from estimation.recording import Flag, Recording, Stretch
from rig.errors import UsageError
from rig.log.convert import write_recording
from rig.log.export import ExportExistsError, ExportFormat, export_log
from rig.log.reader import read_log
from rig.log.streams import COUNTS, SAMPLE


def read_csv(path):
    with path.open(newline="") as file:
        names, *lines = csv.reader(file)
    columns = np.array(lines, dtype=float).T
    return dict(zip(names, columns, strict=True))


def read_parquet(path):
    table = pyarrow.parquet.read_table(path)
    return {name: table[name].to_numpy() for name in table.column_names}


def read_npz(path):
    with np.load(path, allow_pickle=False) as data:
        return dict(data)


READERS = {
    ExportFormat.CSV: read_csv,
    ExportFormat.PARQUET: read_parquet,
    ExportFormat.NPZ: read_npz,
}


@pytest.mark.parametrize("kind", list(ExportFormat))
def test_every_value_is_exported_exactly(tmp_path, log, kind):
    written = export_log(log, kind)
    names = [f"run.rig-sample.{kind.value}", f"run.rig-counts.{kind.value}"]
    assert [item.name for item in written] == names
    assert {item.name for item in tmp_path.iterdir()} == {"run.mcap", *names}
    source = read_log(log)
    for path, topic in zip(written, (SAMPLE, COUNTS), strict=True):
        columns = READERS[kind](path)
        assert list(columns) == ["log_time_ns", *source.topics[topic].columns]
        for name in source.topics[topic].columns:
            np.testing.assert_array_equal(columns[name], source.topics[topic].rows[name])
        assert columns["log_time_ns"].astype(np.uint64)[5] == pytest.approx(
            source.topics[topic].log_time_ns[5], rel=1e-15
        )


@pytest.mark.parametrize("kind", list(ExportFormat))
def test_flags_and_missing_values_are_exported(tmp_path, kind):
    values = np.array([1.0, np.nan, 3.0])
    recording = Recording("a", np.arange(3) * 1e-3, {"motor_current_a": values})
    recording = recording.with_stretch(Stretch(1e-3, 1e-3, Flag.MISSING, "lost"))
    path = write_recording(tmp_path / "a.mcap", recording)
    (written,) = export_log(path, kind)
    columns = READERS[kind](written)
    np.testing.assert_array_equal(columns["motor_current_a"], values)
    np.testing.assert_array_equal(columns["flags"], [0, 4, 0])


def test_topics_go_to_a_folder_and_what_is_there_is_kept_unless_forced(log, tmp_path):
    folder = tmp_path / "new" / "folder"
    written = export_log(log, ExportFormat.CSV, folder)
    assert {item.parent for item in written} == {folder}
    with pytest.raises(UsageError, match="2 topics"):
        export_log(log, ExportFormat.CSV, written[0])
    first, target = written
    first.unlink()
    target.write_text("precious,row\n1,2\n")
    with pytest.raises(ExportExistsError, match="--force"):
        export_log(log, ExportFormat.CSV, folder)
    assert target.read_text() == "precious,row\n1,2\n"
    assert not first.exists()
    export_log(log, ExportFormat.CSV, folder, force=True)
    assert target.read_text().startswith("log_time_ns,motor,spindle")


def test_a_failure_leaves_no_half_file(log, tmp_path, monkeypatch):
    def fail(file, **columns):
        file.write(b"half")
        raise OSError("disk full")

    monkeypatch.setattr(np, "savez_compressed", fail)
    with pytest.raises(OSError, match="disk full"):
        export_log(log, ExportFormat.NPZ)
    assert [item.name for item in tmp_path.iterdir()] == ["run.mcap"]
