"""A rig as a device of bluesky, in plans of the real run engine."""

from pathlib import Path

import pytest

from rig.protocols.protocol import Protocol, protocol_toml

pytest.importorskip("ophyd_async", reason="the extra bluesky is not installed")

from bluesky import plan_stubs, plans, preprocessors
from bluesky.run_engine import RunEngine
from bluesky.utils import FailedStatus
from ophyd_async.core import init_devices

from rig.errors import UsageError
from rig.log.reader import read_log
from rig.log.streams import SAMPLE
from rig.recording.bluesky_device import RecordedRuns

pytestmark = pytest.mark.integration

RUN = {"kind": "sine", "frequencies_hz": [1.0]}
PROTOCOL = {
    "name": "short",
    "runs": [
        RUN | {"loads_a": [0.1, 0.2, 0.3], "duration_s": 1.0},
        RUN | {"loads_a": [0.1], "duration_s": 300.0},
    ],
}


@pytest.fixture
def engine():
    made = RunEngine(call_returns_result=False)
    yield made
    made.loop.call_soon_threadsafe(made.loop.stop)
    made._th.join()
    made.loop.close()


@pytest.fixture
def rig(engine, tmp_path):
    protocol = tmp_path / "short.toml"
    protocol.write_text(protocol_toml(Protocol.model_validate(PROTOCOL)))
    with init_devices():
        rig = RecordedRuns("simulated", str(protocol), tmp_path / "logs")
    return rig


def test_a_scan_records_a_run_a_point_and_names_its_log(engine, rig):
    seen = []
    engine(plans.list_scan([rig], rig.run, [2, 0]), lambda kind, doc: seen.append((kind, doc)))
    events = [doc["data"] for kind, doc in seen if kind == "event"]
    assert [event["rig-run"] for event in events] == [2, 0]
    for event in events:
        log = read_log(Path(event["rig-log_path"]))
        assert log.run.name == rig.names[event["rig-run"]]
        assert log.end.clean
        assert (event["rig-samples"], event["rig-lost"], event["rig-remark"]) == (1000, 0, "")


def test_a_plan_that_fails_leaves_the_session_closed_and_the_rig_can_be_staged_again(engine, rig):
    with pytest.raises(FailedStatus) as failed:
        engine(plans.list_scan([rig], rig.run, [7]))
    assert isinstance(failed.value.__cause__, UsageError)
    engine(plans.list_scan([rig], rig.run, [1]))
    assert read_log(next(rig.folder.glob("001*"))).end.clean


def test_a_run_ends_with_the_plan_and_nothing_is_recorded_without_a_session(engine, rig):
    @preprocessors.stage_decorator([rig])
    def left_early():
        yield from plan_stubs.mv(rig.run, 3)
        yield from plan_stubs.trigger(rig, wait=False)
        while not list(rig.folder.glob("003*")):
            yield from plan_stubs.null()

    with pytest.raises(FailedStatus, match="was aborted after"):
        engine(left_early())
    (left,) = rig.folder.glob("003*")
    log = read_log(left, tolerant=True)
    assert len(log.topics[SAMPLE].rows) < 300_000
    with pytest.raises(FailedStatus, match="no session"):
        engine(plan_stubs.trigger(rig, wait=True))
