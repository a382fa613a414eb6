"""Recording a campaign: whole logs, resumable, nothing overwritten."""

import itertools
import json
import re
import subprocess
import sys
from collections import namedtuple
from contextlib import contextmanager

import numpy as np
import pytest

from drivers.transport.simulated import SimulatedTransport
from rig.bench.session import Session
from rig.configuration.config import SHIPPED
from rig.errors import UsageError
from rig.importers.questions import questions
from rig.importers.registry import open_campaign
from rig.log.check import Verdict, check_log
from rig.log.reader import read_log
from rig.log.streams import COUNTS, SAMPLE
from rig.recording.campaign import open_campaign_folder, record_campaign
from tests.rig.simulated import behind, protocol_file, short_protocol, simulated, transport

pytestmark = pytest.mark.integration


def record(folder, config=None, protocol=None, resume=False, link=None, **options):
    config = config or simulated()
    plans = open_campaign_folder(folder, protocol or short_protocol(), config, resume)
    with Session(config, link or transport(config)) as session:
        return list(record_campaign(session, plans, folder, **options))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("campaign") / "runs"
    record(path, notes="new cable")
    return path


def test_a_campaign_is_one_whole_log_a_run_with_what_was_known(folder):
    logs = sorted(folder.glob("*.mcap"))
    assert [log.stem for log in logs] == [f"00{k}-sine-1Hz-0.{k + 1}A" for k in range(3)]
    assert {check_log(log).verdict for log in logs} == {Verdict.COMPLETE}
    assert not list(folder.glob("*.part"))
    runs = list(open_campaign(folder))
    assert [r.conditions["load_command_a"] for r in runs] == [0.1, 0.2, 0.3]
    for run in runs:
        assert len(run) == 1000
        assert run.time_s[0] == 0.0
        assert run.notes.startswith("new cable")
        assert run.instrument.serial == "SIM-TOOL-1"
        assert set(run.calibrations) == {"reference"}
        assert run.valid.all()
    assert (np.diff([run.started_at_ns for run in runs]) > 1e9).all()


def test_si_samples_and_counts_agree(folder):
    log = read_log(sorted(folder.glob("*.mcap"))[0])
    sample, counts = log.topics[SAMPLE].rows, log.topics[COUNTS].rows
    np.testing.assert_array_equal(sample["sequence"], counts["sequence"])
    zero = log.run.zeros_before["proximal_torque_n_m_counts"]
    np.testing.assert_allclose(
        sample["proximal_torque_n_m"], (counts["proximal"] - zero) * 0.000039811
    )
    names = {attached.name for attached in log.attachments}
    assert names == {"config.json", "calibrations.json"}
    assert log.end.drift_verdict == "steady"
    assert set(log.end.drift) == {"proximal_torque_n_m", "distal_torque_n_m", "motor_current_a"}


def test_the_hidden_effect_is_not_in_the_recording(tmp_path):
    hiding = simulated(hidden={"motor_ripple": 0.987}, draw_hidden=4321)
    record(tmp_path, hiding, short_protocol(1))
    told = [p.read_text() for p in tmp_path.rglob("*") if p.is_file() and p.suffix != ".mcap"]
    for path in tmp_path.glob("*.mcap"):
        log = read_log(path)
        told += [a.data.decode() for a in log.attachments]
        told.append(json.dumps([dict(log.run.conditions), log.run.notes, dict(log.run.details)]))
    assert any("simulation" in text for text in told)
    assert not [text for text in told if "ripple" in text or "0.987" in text or "4321" in text]
    # and yet another hidden effect is another campaign
    with pytest.raises(UsageError, match="another protocol or configuration"):
        record(tmp_path, simulated(hidden={"motor_drag": 1.0}), short_protocol(1), resume=True)


def test_a_command_that_the_protocol_holds_constant_is_not_asked_about(folder):
    run = next(iter(open_campaign(folder).evidence))
    assert np.ptp(run["load_command_a"]) == 0
    assert [text for text in questions([run]) if "is the sensor connected?" in text] == []
    dead = run.with_columns(motor_current_a=np.zeros(len(run)))
    assert any(text.startswith("motor_current_a: it is constant") for text in questions([dead]))


def test_one_seed_gives_one_campaign(folder, tmp_path):
    record(tmp_path / "again")
    for log in sorted(folder.glob("*.mcap")):
        first = read_log(log).topics[COUNTS].rows
        second = read_log(tmp_path / "again" / log.name).topics[COUNTS].rows
        np.testing.assert_array_equal(first, second)


def test_an_aborted_campaign_resumes_and_loses_nothing(tmp_path):
    def abort(name, samples, expected):
        if name.startswith("001") and samples >= 400:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        record(tmp_path, on_progress=abort)
    first = (tmp_path / "000-sine-1Hz-0.1A.mcap").read_bytes()
    (aborted,) = tmp_path.glob("001*")
    kept = read_log(aborted, tolerant=True).topics[COUNTS]
    results = record(tmp_path, resume=True)
    assert [r.name[:3] for r in results] == ["001", "002"]
    assert (tmp_path / "000-sine-1Hz-0.1A.mcap").read_bytes() == first
    assert len(kept) >= 400
    (aborted,) = tmp_path.glob("001*aborted*")
    assert len(read_log(aborted, tolerant=True).topics[COUNTS]) == len(kept)
    assert len(open_campaign(tmp_path).evidence) == 3
    assert all(run.started_at_ns for run in open_campaign(tmp_path))


def test_a_folder_that_is_recorded_into_is_refused_to_others(tmp_path):
    folder = tmp_path / "runs"
    with behind_a_recording(folder) as number:
        for resume in (True, False):
            with pytest.raises(UsageError, match=f"Process {number} records into") as refused:
                record(folder, resume=resume)
            assert "--resume" not in refused.value.fix
        config = simulated()
        with (
            pytest.raises(UsageError, match=f"Process {number} records into"),
            Session(config, transport(config)) as session,
        ):
            list(record_campaign(session, short_protocol().any_plans(), folder))
        assert not list(folder.glob("*.mcap*"))
    assert len(record(folder, resume=True)) == 3


@contextmanager
def behind_a_recording(folder):
    """Open a campaign's folder and hold it by another process, which is killed at the end."""
    open_campaign_folder(folder, short_protocol(), simulated(), resume=False)
    code = (
        "import sys\nfrom rig.bench.holding import holding\n"
        f"with holding({str(folder.resolve())!r}):\n    print('held', flush=True)\n"
        "    sys.stdin.read()"
    )
    pipe = subprocess.PIPE
    with subprocess.Popen([sys.executable, "-c", code], stdin=pipe, stdout=pipe) as other:
        assert other.stdout.readline()
        yield other.pid
        other.kill()


def test_a_run_completed_since_it_was_listed_is_not_made_again(tmp_path):
    config = simulated()
    plans = open_campaign_folder(tmp_path, short_protocol(2), config, resume=False)
    record(tmp_path, protocol=short_protocol(2), resume=True)
    with Session(config, transport(config)) as session:
        assert not list(record_campaign(session, plans, tmp_path))
    assert not list(tmp_path.glob("*aborted*"))


def test_nothing_is_overwritten(folder, tmp_path):
    with pytest.raises(UsageError, match="already holds a campaign"):
        record(folder)
    with pytest.raises(UsageError, match="another protocol"):
        record(folder, protocol=short_protocol(2), resume=True)
    with pytest.raises(UsageError, match="another protocol or configuration"):
        record(folder, config=simulated(seed=5), resume=True)
    (tmp_path / "thesis.txt").write_text("mine")
    with pytest.raises(UsageError, match="not empty"):
        record(tmp_path)


@pytest.mark.parametrize("place", ["thesis.txt", "thesis.txt/runs", "/dev/null", "/proc/runs"])
def test_what_can_be_no_folder_is_refused(tmp_path, place, said):
    (tmp_path / "thesis.txt").write_text("mine")
    err = said("record --sim -o", tmp_path / place, code=2).err
    assert "cannot be made a folder" in err
    assert "--out" in err


def test_a_run_beyond_a_limit_is_refused_before_there_is_a_folder(tmp_path, said):
    config, text = tmp_path / "rig.toml", (SHIPPED / "simulated.toml").read_text()
    config.write_text(re.sub(r"(?m)^load_command_a = \S+", "load_command_a = 0.0", text))
    protocol = protocol_file(tmp_path)
    err = said("record -c", config, "-p", protocol, "-o", tmp_path / "runs", code=2).err
    assert "load_command_a = 0.1" in err
    assert not (tmp_path / "runs").exists()
    assert "load_command_a = 0.1" in said("live -c", config, "-p", protocol, code=2).err


def test_a_full_disk_is_seen_before_anything_moves(tmp_path, monkeypatch):
    usage = namedtuple("usage", "total used free")
    monkeypatch.setattr("shutil.disk_usage", lambda path: usage(10, 10, 1000))
    with pytest.raises(UsageError, match="are free"):
        record(tmp_path / "full")


def test_lost_samples_make_a_run_incomplete_and_are_listed(tmp_path):
    config = simulated()
    link = transport(config)
    generator = np.random.default_rng(1)

    def damage(data):
        bad = bytearray(data)
        if len(bad) > 1000:
            bad[int(generator.integers(0, len(bad)))] ^= 0x11
        return bytes(bad)

    lossy = behind(SimulatedTransport(link.board, step_s=0.2), damage)
    (result,) = record(tmp_path, config, short_protocol(1), link=lossy)
    assert 0 < result.expected - result.samples < 40
    assert "lost" in result.remark
    report = check_log(result.path)
    assert report.verdict is not Verdict.COMPLETE
    topic = next(t for t in report.topics if t.topic == SAMPLE)
    assert topic.received == result.samples
    assert sum(gap.samples for gap in topic.gaps) + topic.received <= result.expected
    assert topic.gaps


def test_a_drifting_sensor_is_reported(tmp_path):
    config = simulated().changed(drift={"proximal_torque_n_m": 1e-9})
    (result,) = record(tmp_path, config, short_protocol(1))
    assert result.drifted == ("proximal_torque_n_m",)
    assert "zero of proximal_torque_n_m moved" in result.remark
    assert "drifted" in read_log(result.path).end.drift_verdict


def test_an_interrupted_command_states_its_runs_and_how_to_go_on_as_json(
    tmp_path, answered, monkeypatch
):
    def interrupted(*words, **more):
        yield from itertools.islice(record_campaign(*words, **more), 1)
        raise KeyboardInterrupt

    monkeypatch.setattr("rig.recording.campaign.record_campaign", interrupted)
    protocol, out = protocol_file(tmp_path, runs=2, duration_s=0.5), tmp_path / "out"
    found = answered("record -p", protocol, "-o", out, code=130)
    assert [run["samples"] for run in found["runs"]] == [500]
    assert found["interrupted"]
    assert found["resume"] == f"rig record --resume {out}"


def test_the_command_records_and_reports_what_next(tmp_path, said, answered):
    out = tmp_path / "out"
    words = ("record --json -p", protocol_file(tmp_path, duration_s=0.5), "-o", out)
    captured = said(*words)
    told = json.loads(captured.out)
    assert told["runs"][0]["samples"] == 500
    assert told["look_at"] == []
    assert "rig log check" in captured.err
    assert "rig record --resume" in said(*words, code=2).err
    printed = said("record --seed 3 --resume", out, code=2).err
    assert "goes on as the campaign was begun" in printed
    (out / "000-sine-1Hz-0.1A.mcap").unlink()
    again = answered("record --resume", out)
    assert [run["samples"] for run in again["runs"]] == [500]
    assert "holds no campaign" in said("record --resume", tmp_path, code=2).err
