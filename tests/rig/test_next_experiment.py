"""Noise floor and next experiment from logs of the simulated rig, here and on a cluster."""

import json
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import pytest

from estimation.causes.experiment import question
from estimation.causes.layout import prepared
from estimation.causes.verdict import Answer, answer
from estimation.diagnosis.split import split
from estimation.recording import Recording
from rig.campaigns.work import engine
from rig.configuration.config import load_config
from rig.diagnosis.propose import menu, propose, simulated_rig, within, write_protocol
from rig.diagnosis.run import noise_floors, repeats
from rig.errors import UsageError
from rig.protocols.protocol import load_protocol, protocol_toml
from rig.simulation.hidden import HiddenEffect
from tests.rig.rippled import MOTOR, record

pytestmark = pytest.mark.long

PATIENCE_S = 120.0


@pytest.fixture(scope="module")
def rippled() -> list[Recording]:
    return prepared(record(HiddenEffect("motor_ripple", 1.0)))


@pytest.fixture(scope="module")
def answered(rippled: list[Recording]) -> Answer:
    return answer(rippled, [MOTOR], split(rippled, 0))


@pytest.fixture(scope="module")
def doubtful(answered: Answer) -> Answer:
    """The same answer with the first finding less sure than it is."""
    first = replace(answered.diagnosis.findings[0], verdict="one_of", confidence=0.5)
    diagnosis = replace(answered.diagnosis, findings=(first, *answered.diagnosis.findings[1:]))
    return replace(answered, diagnosis=diagnosis)


@pytest.fixture(scope="module")
def proposed(doubtful: Answer, rippled: list[Recording]) -> dict[str, Any]:
    found = propose(doubtful, rippled)
    assert found is not None
    return found


@pytest.fixture(scope="module")
def bare(rippled: list[Recording]) -> list[Recording]:
    """The runs without a channel that the simulated rig needs."""
    return [
        replace(r, columns={n: v for n, v in r.columns.items() if n != "load_command_a"})
        for r in rippled
    ]


def test_a_sure_name_needs_no_experiment(answered, rippled):
    assert answered.diagnosis.findings[0].family == "ripple.motor"
    assert answered.diagnosis.verdict == "identified"
    assert propose(answered, rippled) is None


def test_a_name_without_a_likely_alternative_needs_no_experiment(doubtful, rippled):
    kept = doubtful.kept[0]
    single = replace(doubtful, kept=(replace(kept, likely=kept.likely[:1]), *doubtful.kept[1:]))
    assert propose(single, rippled) is None


def test_hypotheses_have_the_probabilities_of_the_finding(doubtful):
    """Test runs may turn the order of two families that the training runs cannot tell apart."""
    kept = doubtful.kept[0]
    families = list(dict.fromkeys(s.candidate.cause.family for s in kept.ranked))[:2]
    likely = [next(p for p in kept.likely if p.family == family) for family in reversed(families)]
    turned = [replace(p, share=share) for p, share in zip(likely, (0.7, 0.2), strict=True)]
    asked = question(replace(doubtful, kept=(replace(kept, likely=turned), *doubtful.kept[1:])), 0)
    assert asked is not None
    assert [h.label for h in asked.hypotheses] == [families[1], families[0]]
    assert [h.probability for h in asked.hypotheses] == pytest.approx([7 / 9, 2 / 9])


def test_repeats_are_found_by_what_was_asked(rippled):
    names = [r.name for r in rippled]
    assert repeats(rippled) == [(names[6], names[7]), (names[6], names[8]), (names[7], names[8])]


def test_the_noise_floor_is_below_the_error_that_remains(answered, rippled):
    floor = noise_floors(answered.refits, rippled)["motor"]
    assert 0.3 * answered.diagnosis.errors["motor"].after < floor
    assert floor < 1.2 * answered.diagnosis.errors["motor"].after


def test_a_repeat_that_was_left_out_has_no_part_in_the_noise_floor(answered, rippled):
    short = replace(rippled[6], name="left out")
    assert (short.name, rippled[7].name) in repeats([short, *rippled])
    assert noise_floors(answered.refits, [short, *rippled]) == noise_floors(
        answered.refits, rippled
    )


def test_every_experiment_of_the_menu_is_a_protocol_within_the_limits(answered, rippled, tmp_path):
    rig = simulated_rig([e.model for e in answered.layout.equations.values()], rippled)
    limits = load_config().limits
    offered = menu(rippled, limits)
    assert len({protocol.name for protocol in offered}) == len(offered) >= 8
    for protocol in offered:
        path = tmp_path / f"{protocol.name}.toml"
        path.write_text(protocol_toml(protocol))
        again = load_protocol(str(path))
        assert [p.name for p in again.plans()] == [p.name for p in protocol.plans()]
        assert len(protocol.plans()) >= 3  # some train, one tests
        first = rig.play(protocol.plans()[0], 1)
        assert within([first], limits), protocol.name
    tight = limits.model_copy(update={"motor_current_a": 1e-3})
    assert not within(rippled[:1], tight)


def test_a_set_gets_an_experiment_that_record_can_run(proposed, doubtful, tmp_path):
    assert proposed["between"][0] == "ripple.motor"
    assert len(set(proposed["between"])) == len(proposed["between"]) >= 2
    assert proposed["discrimination"] > max(0.0, *proposed["others"].values()) - 0.1
    json.dumps(proposed, allow_nan=False)
    path = tmp_path / "next.toml"
    diagnosis = replace(doubtful.diagnosis, next_experiment=proposed)
    assert f"rig record --protocol {path}" in write_protocol(diagnosis, path)
    assert load_protocol(str(path)).plans()


def test_without_a_simulated_rig_the_experiment_is_described(bare, doubtful, tmp_path):
    assert simulated_rig([e.model for e in doubtful.layout.equations.values()], bare) is None
    by_hand = propose(doubtful, bare)
    assert by_hand["protocol"] is None
    assert by_hand["description"]
    diagnosis = replace(doubtful.diagnosis, next_experiment=by_hand)
    assert "by hand" in write_protocol(diagnosis, tmp_path / "no.toml")
    assert not (tmp_path / "no.toml").exists()


def test_processes_propose_the_experiment_of_one(proposed, rippled, doubtful):
    with ProcessPoolExecutor(2) as executor:
        assert propose(doubtful, rippled, executor) == proposed


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
    pytest.importorskip("distributed")
    known = tmp_path / "scheduler.json"
    local = ("--host", "127.0.0.1", "--no-dashboard")
    processes = [start("dask_scheduler", *local, "--port", "0", "--scheduler-file", str(known))]
    try:
        deadline = time.monotonic() + PATIENCE_S
        while not known.exists() or not known.read_text().strip():
            assert time.monotonic() < deadline, "the scheduler did not start"
            time.sleep(0.05)
        made = Cluster(json.loads(known.read_text())["address"])
        for k in range(2):
            folder = str(tmp_path / f"worker{k}")
            words = (*local, "--nthreads", "1", "--no-nanny", "--local-directory", folder)
            made.workers.append(start("dask_worker", made.address, *words))
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
def test_a_cluster_that_loses_a_worker_gives_the_same_experiment(
    cluster, proposed, rippled, doubtful
):
    import distributed

    with engine(scheduler=cluster.address) as executor:
        client = distributed.get_client(cluster.address)
        client.wait_for_workers(2, timeout=PATIENCE_S)
        losing = Losing(executor, cluster.workers[0])
        there = propose(doubtful, rippled, losing)
        assert losing.maps == 1
        assert len(client.scheduler_info()["workers"]) == 1
    assert there == proposed


def test_without_workers_the_work_is_done_here():
    with engine() as executor:
        assert executor is None
    with engine(2) as executor:
        future: Future[int] = executor.submit(abs, -3)
        assert future.result() == 3


def test_no_workers_and_no_scheduler_are_usage_errors():
    pytest.importorskip("distributed")
    with pytest.raises(UsageError, match="1 or more"), engine(0):
        pass
    with (
        pytest.raises(UsageError, match="No scheduler answers"),
        engine(scheduler="tcp://127.0.0.1:1", connect_s=0.2),
    ):
        pass
