"""Where a diagnosis works: a cluster of two workers, one of them killed, and the same answer."""

import json
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import Executor, Future
from dataclasses import dataclass, field, replace
from pathlib import Path

import pytest

from estimation.causes.equations import on_one_clock
from estimation.causes.verdict import answer
from estimation.diagnosis.split import split
from rig.cli.main import main
from rig.diagnosis.engine import engine
from rig.diagnosis.propose import propose
from rig.errors import UsageError
from rig.simulation.hidden import HiddenEffect
from tests.rig.rippled import MOTOR, record

pytestmark = pytest.mark.long

distributed = pytest.importorskip("distributed")

PATIENCE_S = 120.0


@dataclass
class Cluster:
    """A scheduler and its workers, each a process of this test."""

    address: str
    workers: list[subprocess.Popen[bytes]] = field(default_factory=list)


def start(module: str, *words: str) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-W", "ignore", "-m", f"distributed.cli.{module}", *words]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    known = tmp_path / "scheduler.json"
    local = ("--host", "127.0.0.1", "--no-dashboard")
    processes = [start("dask_scheduler", *local, "--port", "0", "--scheduler-file", str(known))]
    try:
        deadline = time.monotonic() + PATIENCE_S
        while not known.exists() or not known.read_text().strip():
            assert time.monotonic() < deadline, "the scheduler did not start"
            time.sleep(0.05)
        address = json.loads(known.read_text())["address"]
        made = Cluster(address)
        for k in range(2):
            folder = str(tmp_path / f"worker{k}")
            words = (address, *local, "--nthreads", "1", "--no-nanny", "--local-directory", folder)
            made.workers.append(start("dask_worker", *words))
        processes += made.workers
        yield made
    finally:
        for process in processes:
            process.kill()
            process.wait()


class Losing:
    """An executor that loses one worker when work has been given to both."""

    def __init__(self, executor: Executor, victim: subprocess.Popen[bytes]) -> None:
        self.executor, self.victim, self.maps = executor, victim, 0

    def map(self, *arguments):
        self.maps += 1
        results = self.executor.map(*arguments)
        self.victim.kill()
        self.victim.wait()
        return results


@pytest.mark.filterwarnings("ignore")  # the cluster's own, about sizes and versions
def test_a_cluster_that_loses_a_worker_gives_the_same_experiment(cluster) -> None:
    recordings = on_one_clock(record(HiddenEffect("motor_ripple", 1.0)))
    found = answer(recordings, [MOTOR], split(recordings, 0))
    unsure = replace(found.diagnosis.findings[0], verdict="one_of")
    found = replace(found, diagnosis=replace(found.diagnosis, findings=(unsure,)))
    with engine(scheduler=cluster.address) as executor:
        client = distributed.get_client(cluster.address)
        client.wait_for_workers(2, timeout=PATIENCE_S)
        losing = Losing(executor, cluster.workers[0])
        there = propose(found, recordings, losing)
        assert losing.maps == 1
        assert len(client.scheduler_info()["workers"]) == 1
    assert there is not None
    assert there == propose(found, recordings)


def test_without_workers_the_work_is_done_here() -> None:
    with engine() as executor:
        assert executor is None
    with engine(2) as executor:
        future: Future[int] = executor.submit(abs, -3)
        assert future.result() == 3


def test_no_workers_and_no_scheduler_are_usage_errors(monkeypatch, tmp_path, capsys) -> None:
    with pytest.raises(UsageError, match="1 or more"), engine(0):
        pass
    monkeypatch.setattr("rig.diagnosis.engine.CONNECT_S", 0.2)
    words = ["diagnose", str(tmp_path), "--equation", "motor", "--scheduler", "tcp://127.0.0.1:1"]
    assert main(words) == 2
    assert "No scheduler answers" in capsys.readouterr().err
