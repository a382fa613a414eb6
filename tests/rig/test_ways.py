"""The ways a rig without hardware runs, held to one contract: record and live, unchanged.

Fakes in virtual time, the firmware's library in virtual time, its process on a pty in real
time, and an EPOS4's fake on a virtual CAN bus in real time.
"""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from rig.cli.main import main
from rig.configuration.config import SHIPPED, load_config
from rig.log.reader import LogFile, read_log
from rig.protocols.protocol import Protocol, protocol_toml

pytestmark = pytest.mark.integration

WAYS = {
    "fakes": ("simulated", "firmware = false"),
    "library": ("simulated", "firmware = true"),
    "process": ("pty", ""),
    "can": ("canopen_virtual", ""),
}
Logs = dict[str, LogFile]
COMMON = ("spindle_angle_rad", "target_angle_rad", "motor_angle_rad", "motor_current_a")


@pytest.fixture(scope="module")
def protocol(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("protocol") / "short.toml"
    run = {"kind": "sine", "frequencies_hz": [2.0], "loads_a": [0.0], "duration_s": 0.5}
    path.write_text(protocol_toml(Protocol.model_validate({"name": "short", "runs": [run]})))
    return str(path)


def configured(way: str, folder: Path) -> str:
    """The shipped configuration, patient with a machine that does other things too."""
    name, simulation = WAYS[way]
    text = (SHIPPED / f"{name}.toml").read_text()
    assert text.count("[simulation]") <= 1
    if simulation:
        text = text.replace("[simulation]", f"[simulation]\n{simulation}")
    text = re.sub(r"\[devices[^[]*", "", text)  # what is beside the logger is another test's
    if "[safety]" not in text:
        text += "\n[safety]\n"
    lines = [line for line in text.splitlines() if not line.startswith("watchdog_s")]
    text = "\n".join(lines).replace("[safety]", "[safety]\nwatchdog_s = 1.0")
    path = folder / f"{way}.toml"
    path.write_text(text + "\n")
    load_config(path)
    return str(path)


@pytest.fixture(scope="module")
def logs(library: Path, protocol: str, tmp_path_factory: pytest.TempPathFactory) -> Logs:
    """The same protocol recorded in every way, as a person types it."""
    recorded = {}
    for way in WAYS:
        folder = tmp_path_factory.mktemp(way)
        out = folder / "campaign"
        words = ["record", "-c", configured(way, folder), "-p", protocol, "-o", str(out)]
        assert main(words) == 0, way
        assert main(["log", "check", str(out)]) == 0, way
        (path,) = out.glob("*.mcap")
        recorded[way] = read_log(path)
    return recorded


def test_every_way_writes_the_same_log_and_the_spindle_follows(logs):
    first = logs["fakes"]
    wanted = first.topics["/rig/sample"].rows["target_angle_rad"]
    for way, log in logs.items():
        assert {"/rig/sample", "/rig/counts"} <= set(log.topics), way
        counts = log.topics["/rig/counts"].rows
        assert counts.dtype == first.topics["/rig/counts"].rows.dtype, way
        rows = log.topics["/rig/sample"].rows
        assert len(rows) == len(counts) == 500, way
        assert (np.diff(rows["sequence"].astype(np.int64)) == 1).all(), way
        assert (np.diff(rows["time_s"]) > 0).all(), way
        assert all(np.isfinite(rows[name]).all() for name in COMMON), way
        assert log.end.clean, way
        told = {name for name in log.run.details if not name.startswith("clock_residual_s_jaw")}
        assert told == set(first.run.details), way
        np.testing.assert_allclose(rows["target_angle_rad"], wanted, atol=1e-3, err_msg=way)
        behind = np.abs(rows["spindle_angle_rad"] - rows["target_angle_rad"])
        assert np.median(behind) < 0.05, way
        assert np.ptp(rows["motor_angle_rad"]) > 10 * np.ptp(rows["spindle_angle_rad"]), way


def test_fake_and_library_leave_the_same_counts(logs):
    fake, library = (logs[way].topics["/rig/counts"].rows for way in ("fakes", "library"))
    for name in ("motor", "spindle", "current", "proximal", "target", "command_e4"):
        np.testing.assert_array_equal(fake[name], library[name], err_msg=name)


@pytest.mark.parametrize("way", list(WAYS))
def test_every_way_is_shown_live(way, library, protocol, tmp_path, said):
    words = ("live --pace 0 --duration 1 --json -c", configured(way, tmp_path), "-p", protocol)
    *_, last = (json.loads(line) for line in said(*words).out.splitlines())
    assert last["summary"]["ended"] == "finished"
    assert last["summary"]["lost"] == 0
    assert last["summary"]["samples"] >= 1000
