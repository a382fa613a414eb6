"""Random sequences of commands and faults against the compiled core, and the search itself."""

import shutil
import subprocess
from pathlib import Path

import pytest

from benchmarks.hunt import FIRMWARE, MOST_EVENTS, Search, joined, run, write_settings

pytestmark = [
    pytest.mark.integration,
    pytest.mark.skipif(shutil.which("g++") is None, reason="g++ is not installed"),
]

SANITIZED = ("-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")


def built(folder, flags=("-O1",), firmware=FIRMWARE, name="hunt"):
    program = folder / name
    words = ["g++", "-std=c++17", "-ffp-contract=off", *flags, "-o", str(program)]
    subprocess.run([*words, str(firmware / "proofs" / f"{name}.cpp")], check=True)
    return program


@pytest.fixture(scope="module")
def settings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("settings") / "settings.bin"
    write_settings(path)
    return path


@pytest.fixture(scope="module")
def sanitized(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return built(tmp_path_factory.mktemp("hunt"), SANITIZED)


def test_no_sequence_of_commands_arms_without_a_live_session_or_moves_beyond_the_limits(
    sanitized, settings
):
    found = run(sanitized, settings, "commands", 0, 3000)
    assert found.found == []
    assert found.armings > 1000
    assert found.trips > 1000


def test_no_sequence_of_faults_breaks_a_rule(sanitized, settings):
    found = run(sanitized, settings, "faults", 0, 400)
    assert found.found == []
    assert found.trips > 200
    assert found.farthest_rad > 2.5


BROKEN = {
    "armed without a sign of life of its session": (
        *("board.hpp", "armed() && silent_us > patience_us"),
        "armed() && silent_us > 100 * patience_us",
    ),
    "armed with a number that was not offered": (
        *("session.hpp", "if (number != offer()) return false;"),
        "if (number == 0) return false;",
    ),
    "in force while the emergency stop is pressed": (
        *("board.hpp", "if (stopped_ && (in_force()"),
        "if (stopped_ && !armed() && (in_force()",
    ),
    "a trip was cleared by something else than its own name": (
        *("board.hpp", "if (code != first_.code) return kWrongTrip;", ""),
    ),
    "a load beyond its limit": (
        *("board.hpp", "allowed = allowed && profile_.allow(staged_[i]);", ""),
    ),
}
"""Rule of the search -> file of the core, a part of it, and what breaks the rule in its place."""


@pytest.mark.long
@pytest.mark.parametrize("rule", BROKEN)
def test_a_core_that_breaks_a_rule_is_found_with_few_events(rule, settings, tmp_path):
    file, text, change = BROKEN[rule]
    firmware = tmp_path / "firmware"
    for part in ("core", "proofs"):
        shutil.copytree(FIRMWARE / part, firmware / part)
    source = firmware / "core" / file
    assert text in source.read_text()
    source.write_text(source.read_text().replace(text, change))
    program = built(tmp_path, firmware=firmware)
    searched = Search()
    for kind in ("commands", "faults"):
        searched = joined(searched, run(program, settings, kind, 0, 1500))
    found = [events for _, broken, events in searched.found if broken == rule]
    assert found
    assert min(len(events) for events in found) <= MOST_EVENTS


@pytest.mark.long
def test_every_small_input_and_every_short_sequence_of_commands(settings, tmp_path):
    program = built(tmp_path, SANITIZED, name="small")
    done = subprocess.run(
        [str(program), str(settings), "3"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout[-500:] + done.stderr[-2000:]
    cases = dict(line.rsplit(": ", 1) for line in done.stdout.splitlines())
    assert all(int(count) > 1000 for count in cases.values())
    assert int(cases["commands and events"]) == 2 * 15**3
