"""Theorems on the firmware's core: what they state, and that a broken core breaks them."""

import shutil

import pytest

from benchmarks import core_proofs
from benchmarks.core_mutants import PROOFS_PYTHON, THEOREMS
from benchmarks.hunt import FIRMWARE

needs_angr = pytest.mark.skipif(
    not PROOFS_PYTHON.exists() or shutil.which("g++") is None,
    reason="no angr: make proofs installs it",
)


def test_every_theorem_states_what_it_shows_and_has_a_function():
    source = (FIRMWARE / core_proofs.SOURCE).read_text()
    found = core_proofs.theorems()
    assert len(found) == source.count("\nTHEOREM(")
    assert all(text.endswith(".") for text in found.values())


def test_mutants_of_a_file_are_held_against_theorems_that_exist():
    named = {name for names in THEOREMS.values() for name in names}
    assert named <= set(core_proofs.theorems())
    assert all((FIRMWARE / "core" / file).is_file() for file in THEOREMS)


def test_a_broken_claim_is_on_the_page():
    sound = core_proofs.Decided("one", "States one.", 3, 0.5, ())
    broken = core_proofs.Decided("two", "States two.", 3, 0.5, ("a trip stays",))
    rows = core_proofs.page([sound, broken]).splitlines()
    assert any("States one." in row and "| yes |" in row for row in rows)
    assert any("States two." in row and "a trip stays" in row for row in rows)


@pytest.mark.long
@needs_angr
@pytest.mark.parametrize(
    ("file", "sound", "broken", "theorem"),
    [
        ("session.hpp", "ahead < 0x8000U", "ahead <= 0x8000U", "sequence_window"),
        ("setpoint_queue.hpp", "first_ = (first_ + 1) % Capacity;", "", "queue_step"),
        ("watchdog.hpp", "heard_ = false;\n", "\n", "watchdog_steps"),
        ("framing.hpp", "length_ < kMaxWire", "length_ <= kMaxWire", "receiver_byte"),
    ],
)
def test_a_theorem_holds_for_the_core_and_not_for_a_damaged_one(
    tmp_path, file, sound, broken, theorem
):
    folder = tmp_path / "firmware"
    shutil.copytree(FIRMWARE, folder, ignore=shutil.ignore_patterns("build"))
    program = core_proofs.build(folder)
    assert core_proofs.decide(program, theorem, str(PROOFS_PYTHON)).broken == ()
    source = folder / "core" / file
    text = source.read_text()
    assert sound in text
    source.write_text(text.replace(sound, broken, 1))
    program = core_proofs.build(folder)
    assert core_proofs.decide(program, theorem, str(PROOFS_PYTHON)).broken
