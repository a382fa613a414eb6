"""Folders and archives of MRDLab logs: which runs, in which order, how named, read when asked."""

import io
import json
import tarfile
from pathlib import Path

import numpy as np
import pytest

from rig.errors import DataError
from rig.importers import archive
from rig.importers.jaw_steps import JAW, with_one_zero
from rig.importers.mrdlab import IMPORTER

FOLDERS = ("Tool_4_Maryland_L_Pitch_1", "Tool_4_Maryland_L_Roll_1")


@pytest.fixture
def one(tmp_path, make_log) -> Path:
    """A folder of three logs and their text files."""
    folder = tmp_path / "Tool_4_Maryland_L_4"
    folder.mkdir()
    for stem in ("10", "00", "01"):
        (folder / f"{stem}.TXT").write_text(make_log(seconds=2.5).text())
    (folder / "ReadMe.txt").write_text("This is a roll of 0 degrees\n")
    (folder / "SerialLog.txt").write_text("Please press 's' to begin data collection:\n")
    (folder / "notes.pdf").write_bytes(b"%PDF")
    return folder


@pytest.fixture
def several(tmp_path, make_log) -> Path:
    root = tmp_path / "data"
    for name in FOLDERS:
        (root / name).mkdir(parents=True)
        for stem in ("000", "001"):
            (root / name / f"{stem}.TXT").write_text(make_log(seconds=2.5).text())
    return root


def pack(folder: Path, path: Path) -> Path:
    mode = {".xz": "w:xz", ".gz": "w:gz", ".tar": "w"}[path.suffix]
    with tarfile.open(path, mode) as tar:
        tar.add(folder, folder.name)
    return path


def test_a_folder_is_a_campaign_in_file_order_whose_runs_load_when_asked(one):
    (one / "01.TXT").write_text("not a log\n")
    campaign = IMPORTER.open(one)
    assert campaign.names == ("00", "01", "10")
    assert [run.source for run in campaign.runs] == [one / f"{n}.TXT" for n in campaign.names]
    assert len(campaign.runs[0].recording()) == 2500
    with pytest.raises(DataError, match=r"01\.TXT, line 1"):
        campaign.runs[1].recording()


def test_runs_of_several_folders_carry_the_folder(several):
    campaign = IMPORTER.open(several)
    assert campaign.names == tuple(f"{f}/{s}" for f in FOLDERS for s in ("000", "001"))
    rolls = [r.conditions["wrist_roll_rad"] for r in campaign]
    assert rolls == pytest.approx([0, 0, -np.pi / 2, -np.pi / 2])


@pytest.mark.parametrize("suffix", ["tar.xz", "tar.gz", "tar"])
def test_an_archive_holds_what_its_folder_holds(one, tmp_path, suffix):
    packed = pack(one, tmp_path / f"set.{suffix}")
    assert IMPORTER.recognises(packed)
    campaign, folder = IMPORTER.open(packed), IMPORTER.open(one)
    assert campaign.names == folder.names
    assert campaign.runs[0].source == packed
    for a, b in zip(campaign, folder, strict=True):
        assert a.source == f"{packed}:{one.name}/{a.name}.TXT"
        assert (a.conditions, a.instrument, a.notes) == (b.conditions, b.instrument, b.notes)
        for name in b.columns:
            np.testing.assert_array_equal(a[name], b[name])


def member(name: str, content: bytes = b"%x\n", **attributes) -> tuple[tarfile.TarInfo, io.BytesIO]:
    info = tarfile.TarInfo(name)
    info.size = len(content)
    for key, value in attributes.items():
        setattr(info, key, value)
    return info, io.BytesIO(content)


@pytest.mark.parametrize("name", ["../evil.TXT", "/evil.TXT", "a/../../evil.TXT", "..\\evil.TXT"])
def test_a_name_that_leads_out_of_the_folder_is_refused(tmp_path, name):
    path = tmp_path / "set.tar"
    with tarfile.open(path, "w") as tar:
        tar.addfile(*member("00.TXT"))
        tar.addfile(*member(name))
    with pytest.raises(DataError, match="leads out of its folder"):
        IMPORTER.open(path)
    assert not list(tmp_path.parent.rglob("evil.TXT"))


def test_links_in_an_archive_are_not_followed(tmp_path, make_log):
    path = tmp_path / "set.tar"
    secret = tmp_path / "secret.txt"
    secret.write_text("%secret\n")
    with tarfile.open(path, "w") as tar:
        tar.addfile(*member("ReadMe.txt", b"This is a roll of 0 degrees\n"))
        tar.addfile(*member("00.TXT", make_log(seconds=1).text().encode()))
        for name, kind in (("01.TXT", tarfile.SYMTYPE), ("02.TXT", tarfile.LNKTYPE)):
            tar.addfile(*member(name, b"", type=kind, linkname=str(secret)))
    assert IMPORTER.recognises(path)
    assert IMPORTER.open(path).names == ("00",)


def test_an_archive_that_is_too_large_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(archive, "MAX_TOTAL_BYTES", 1000)
    path = tmp_path / "set.tar"
    with tarfile.open(path, "w") as tar:
        for i in range(3):
            tar.addfile(*member(f"{i}.TXT", b"%" * 400))
    with pytest.raises(DataError, match=r"too large at '2\.TXT'"):
        IMPORTER.open(path)


@pytest.mark.parametrize("keep", [0.0, 0.3, 0.9])
def test_a_truncated_archive_is_refused_and_leaves_nothing(one, tmp_path, monkeypatch, keep):
    packed = pack(one, tmp_path / "set.tar.xz")
    content = packed.read_bytes()
    packed.write_bytes(content[: round(keep * len(content))])
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    monkeypatch.setattr(archive.tempfile, "tempdir", str(scratch))
    with pytest.raises(DataError, match=r"set\.tar\.xz is damaged"):
        IMPORTER.open(packed)
    assert not list(scratch.iterdir())


def test_recognises_logs_and_nothing_else(one, several, tmp_path):
    empty = tmp_path / "empty"
    empty.mkdir()
    (empty / "ReadMe.txt").write_text("nothing here\n")
    other = tmp_path / "other.txt"
    other.write_text("% a comment\n1,2,3\n")
    broken = tmp_path / "broken.tar.xz"
    broken.write_bytes(b"no archive")
    logs = (one, one / "00.TXT", several)
    others = (one / "ReadMe.txt", one / "notes.pdf", empty, other, broken)
    assert all(map(IMPORTER.recognises, logs))
    assert not any(map(IMPORTER.recognises, others))
    with pytest.raises(DataError, match="holds no MRDLab log"):
        IMPORTER.open(empty)


@pytest.fixture
def slipped(tmp_path, make_log):
    """Ten runs of two loads; the jaw's zero steps by 0.54 deg before the seventh."""
    folder = tmp_path / "Tool_4_Maryland_L_4"
    folder.mkdir()
    for i in range(10):
        # the load stretches the cable: runs of different load are not compared
        def edit(rows, i=i):
            rows[:, 4] += 6 * (i >= 6) + i % 3 - 100 * (i % 2)

        log = make_log(seconds=4.0, load_a=(0.1, 0.9)[i % 2], edit=edit)
        (folder / f"{i:02d}.TXT").write_text(log.text())
    return folder


def test_a_jaw_step_is_found_between_runs_of_the_same_load_and_taken_off(slipped):
    campaign = IMPORTER.open(slipped)
    one_zero, (step,) = with_one_zero(campaign, JAW)
    assert step.run == "06"
    assert np.rad2deg(step.step_rad) == pytest.approx(0.54, abs=0.15)
    whole = list(one_zero)
    mean = np.array([np.rad2deg(r["jaw_angle_rad"].mean()) for r in whole])
    assert np.ptp(mean[::2]) < 0.4
    assert np.ptp(mean[1::2]) < 0.4
    np.testing.assert_array_equal(
        whole[9]["jaw_angle_rad"], campaign.runs[9].recording()["jaw_angle_rad"]
    )


def test_a_fit_of_the_jaws_angle_states_the_steps(slipped, said, answered):
    words = ("fit", slipped, "--model states --target")
    printed = said(*words, "jaw_angle_rad --json")
    assert [step["run"] for step in json.loads(printed.out)["jaw_steps"]] == ["06"]
    assert "deg before run 06" in printed.err
    assert answered(*words, "proximal_torque_n_m")["jaw_steps"] == []
