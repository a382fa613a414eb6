"""The bench: repeatable by seed, however calls are cut, and a board called by pointer."""

import ctypes
import itertools
import shutil
import subprocess
from pathlib import Path

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import types

from drivers.teensy import control
from drivers.teensy.logic import Drive
from rig.simulation.bench import BenchInputError, SimulatedBench
from rig.simulation.hidden import NAMES, HiddenEffect
from rig.simulation.parameters import REFERENCE_GAINS

pytestmark = pytest.mark.integration

GAINS = np.array(REFERENCE_GAINS)
TICKS = 600
TARGET = np.round(683 * (1 + np.cos(2 * np.pi * 0.5e-3 * np.arange(TICKS)))).astype(np.int32)
LOAD = np.full(TICKS, 400, np.int32)


def run(seed: int, cuts: tuple[int, ...] = (), **options: object) -> tuple[np.ndarray, np.ndarray]:
    """Counts and final state of one run, advanced in pieces."""
    bench = SimulatedBench(seed=seed, **options)  # type: ignore[arg-type]
    drive = Drive.armed(GAINS)
    edges = [0, *sorted(cuts), TICKS]
    parts = [
        bench.advance(b - a, TARGET[a:b], LOAD[a:b], drive) for a, b in itertools.pairwise(edges)
    ]
    return np.concatenate(parts), bench.state


def test_rows_are_int32_of_all_fields() -> None:
    rows, _ = run(0)
    assert rows.shape == (TICKS, 11)
    assert rows.dtype == np.int32


def test_the_same_seed_gives_the_same_bytes_and_another_does_not() -> None:
    assert run(5)[0].tobytes() == run(5)[0].tobytes()
    assert run(5)[0].tobytes() != run(6)[0].tobytes()


@settings(max_examples=25, deadline=None)
@given(st.lists(st.integers(0, TICKS), max_size=8))
def test_cutting_the_run_changes_nothing(cuts: list[int]) -> None:
    effects = [HiddenEffect(name) for name in NAMES]  # every state there is
    whole, whole_state = run(1, effects=effects)
    pieces, pieces_state = run(1, tuple(cuts), effects=effects)
    assert pieces.tobytes() == whole.tobytes()
    assert pieces_state.tobytes() == whole_state.tobytes()


def test_sensors_are_sampled_before_the_command_acts() -> None:
    bench = SimulatedBench(seed=0)
    away = np.full(2, 0, np.int32)
    rows = bench.advance(2, away, np.zeros(2, np.int32), Drive.armed(GAINS))
    at_rest = SimulatedBench(seed=0).advance(1, away[:1], np.zeros(1, np.int32), Drive.idle())
    np.testing.assert_array_equal(rows[0, :7], at_rest[0, :7])
    assert rows[0, 7] != 0
    assert rows[1, 5] > rows[0, 5] + 100  # the current has answered one tick later


def test_shapes_that_do_not_fit_are_refused() -> None:
    with pytest.raises(BenchInputError, match="target has shape"):
        SimulatedBench().advance(5, TARGET, LOAD[:5], Drive.idle())
    with pytest.raises(BenchInputError, match="address 0x0"):
        SimulatedBench().advance_with_board(5, 0, 0, 0)


@numba.cfunc(
    types.void(
        types.CPointer(types.float64),
        types.uint32,
        types.CPointer(types.int32),
        types.CPointer(types.int32),
    )
)
def controlling_board(board, tick_us, inputs, outputs):  # type: ignore[no-untyped-def]
    """A board that plays a cosine of its own clock through the shared controller."""
    memory = numba.carray(board, 9)
    counts = numba.carray(inputs, 7)
    answer = numba.carray(outputs, 2)
    target = np.round(683 * (1 + np.cos(2 * np.pi * 0.5e-3 * (tick_us // 1000))))
    answer[0] = control.control_tick(memory[:4], memory[4:], int(target), counts[1], counts[0])
    answer[1] = 400


def test_a_board_called_by_pointer_closes_the_same_loop() -> None:
    _, expected = run(2)
    bench = SimulatedBench(seed=2)
    memory = np.concatenate([control.new_state(), GAINS])
    address = controlling_board.address
    bench.advance_with_board(250, address, memory.ctypes.data, 0)
    bench.advance_with_board(TICKS - 250, address, memory.ctypes.data, 250_000)
    assert bench.state.tobytes() == expected.tobytes()
    assert bench.ticks_done == TICKS


BOARD_IN_C = """
#include <stdint.h>
struct board { uint32_t ticks, last_us; int32_t first[7], last[7]; };
void tick(void *memory, uint32_t tick_us, const int32_t *inputs, int32_t *outputs) {
    struct board *b = memory;
    for (int i = 0; i < 7; i++) {
        if (b->ticks == 0) b->first[i] = inputs[i];
        b->last[i] = inputs[i];
    }
    b->ticks++;
    b->last_us = tick_us;
    outputs[0] = -400;
    outputs[1] = 100;
}
"""


class BoardMemory(ctypes.Structure):
    _fields_ = (
        ("ticks", ctypes.c_uint32),
        ("last_us", ctypes.c_uint32),
        ("first", ctypes.c_int32 * 7),
        ("last", ctypes.c_int32 * 7),
    )


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler (cc)")
def test_a_board_in_c_is_driven_and_its_clock_wraps(tmp_path: Path) -> None:
    source, library = tmp_path / "board.c", tmp_path / "board.so"
    source.write_text(BOARD_IN_C)
    subprocess.run(["cc", "-shared", "-fPIC", "-o", str(library), str(source)], check=True)
    tick = ctypes.cast(ctypes.CDLL(str(library)).tick, ctypes.c_void_p).value
    assert tick is not None
    memory = BoardMemory()
    bench = SimulatedBench(seed=0)
    bench.advance_with_board(300, tick, ctypes.addressof(memory), 2**32 - 100_000)
    assert memory.ticks == 300
    assert memory.last_us == 199_000  # wrapped at 2^32
    change = np.array(memory.last) - np.array(memory.first)
    assert change[0] > 1000  # a negative command closes: the motor's count rises
    assert change[1] < 0
    assert change[5] > 50
