"""A small share of `make soak` and `make fuzz`, and that the two go on where they stopped."""

import os
import random
import socket
from pathlib import Path

import pytest

from benchmarks.reliability import __main__ as page
from benchmarks.reliability import fuzz, listening
from benchmarks.reliability.encoder_faults import FAULTS
from benchmarks.reliability.faults import SENSOR_FAULTS, inject
from benchmarks.reliability.targets import TARGETS
from drivers.registry import fakes
from drivers.transport.faulty import Fault

pytestmark = pytest.mark.integration


@pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.name)
def test_a_decoder_refuses_or_reads_right_whatever_comes(target: fuzz.Target) -> None:
    tally = fuzz.Tally()
    fuzz.run_block(target, 10**6, tally, size=150)
    assert tally.failures == []
    assert tally.inputs == 150
    good = [target.run(seed) for seed in target.seeds()]
    assert all(good), "an unharmed input is not accepted"


def test_a_wrong_value_that_is_accepted_is_a_failure() -> None:
    def believes(data: bytes) -> bool:
        assert not data, "wrong"
        return True

    tally = fuzz.Tally()
    fuzz.run_block(fuzz.Target("credulous", lambda: [b"x"], believes, 1), 0, tally, size=50)
    assert 0 < len(tally.failures) <= fuzz.KEPT_FAILURES
    assert "wrong" in tally.failures[0][2]


def test_the_plan_gives_every_decoder_enough_and_all_of_it() -> None:
    plan = fuzz.plan(fuzz.TOTAL)
    assert sum(plan.values()) >= 10_000_000
    assert min(plan.values()) >= 100_000


def test_a_tally_is_gone_on_with(tmp_path) -> None:
    path = tmp_path / "fuzz.json"
    tallies = fuzz.load(path)
    tallies[TARGETS[0].name].inputs = 3000
    tallies[TARGETS[0].name].failures.append((1, "00", "x"))
    fuzz.save(path, tallies)
    again = fuzz.load(path)[TARGETS[0].name]
    assert (again.inputs, list(again.failures[0])) == (3000, [1, "00", "x"])


def test_a_block_is_made_from_its_number_alone() -> None:
    first, second = (
        [fuzz.mutated(random.Random("a:1"), [b"seed"]) for _ in range(2)] for _ in range(2)
    )
    assert first == second


def test_faults_of_every_kind_are_detected_and_end_safe_in_time(library: Path) -> None:
    kinds = len(SENSOR_FAULTS) + len(FAULTS) + 2 + len(Fault) * len(fakes())
    outcomes = list(inject(kinds, seed=5))
    assert len({outcome.kind for outcome in outcomes}) == kinds
    for outcome in outcomes:
        assert outcome.crash == ""
        assert outcome.detected, outcome
        of_a_link = " on the link of " in outcome.kind  # not every protocol tells faults apart
        assert outcome.named or of_a_link, outcome
        assert outcome.mis_stamped == 0, outcome
        silence = outcome.kind in ("host killed", "cable cut")
        if outcome.safe_after_s is not None:
            assert outcome.safe_after_s <= (0.052 if silence else 0.020), outcome
    assert sum(outcome.safe_after_s is not None for outcome in outcomes) == len(SENSOR_FAULTS) + 2


def test_a_part_that_was_not_measured_here_keeps_its_rows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    earlier = page.TABLE.read_text()
    monkeypatch.setattr(fuzz, "STATE", tmp_path / "fuzz.json")
    rows = [line for line in earlier.splitlines() if line.startswith("| ")][1:]
    assert len(rows) >= 2 + 12 + len(TARGETS)
    kept = page.written({}, earlier)
    assert [line for line in kept.splitlines() if line.startswith("| ")][1:] == rows
    kills = {"count": 3, "most_lost_s": 0.5, "median_lost_s": 0.1, "made": "today, abc, 0"}
    changed = page.written({"kills": kills}, earlier).splitlines()
    assert [line for line in changed if line.startswith("| ") and line not in rows][1:] == [
        "| 3 recorders killed: lost, all files repaired, nothing earlier changed | most 0.500 s,"
        " median 0.100 s | 0.25 s in 200 | **no** | today, abc, 0 |"
    ]
    assert "not measured" in page.written({}, "")


def measured(
    words: list[str], folder: Path, monkeypatch: pytest.MonkeyPatch
) -> dict[str, str | None]:
    """Run the command on made-up measurements and return the pages it has written."""
    names = ("STATE", "TABLE", "SHORT_STATE", "SHORT_TABLE")
    paths = {name: folder / name.lower() for name in names}
    for name, path in paths.items():
        monkeypatch.setattr(page, name, path)
    paths["TABLE"].write_text("# The committed table")
    figures = {"count": 200, "most_lost_s": 0.1, "median_lost_s": 0.1}
    monkeypatch.setattr(page, "_MEASURES", {"kills": lambda _: figures, "fuzz": lambda _: {}})
    monkeypatch.setattr(page.fuzz, "STATE", folder / "fuzz.json")
    monkeypatch.setattr("sys.argv", ["reliability", *words])
    assert page.main() == 0
    pages = (paths["TABLE"], paths["SHORT_TABLE"])
    return {path.name: path.read_text() if path.exists() else None for path in pages}


def test_a_short_run_leaves_the_committed_table_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pages = measured(["kills", "--kills", "3"], tmp_path, monkeypatch)
    assert pages["table"] == "# The committed table"
    assert "200 recorders killed" in str(pages["short_table"])
    assert not (tmp_path / "state").exists()


@pytest.mark.skipif(not Path("/proc/self/net/tcp").exists(), reason="needs /proc (Linux)")
def test_listening_sockets_are_distinguished_from_others() -> None:
    before = listening.listening(os.getpid())
    with socket.create_server(("127.0.0.1", 0)) as server:
        (found,) = listening.listening(os.getpid()) - before
        assert int(found.split(":")[1], 16) == server.getsockname()[1]
        assert listening.is_loopback(found)
        with socket.create_connection(server.getsockname()):
            assert listening.listening(os.getpid()) - before == {found}
    assert listening.listening(os.getpid()) == before
    assert not listening.is_loopback("00000000:1F90")
