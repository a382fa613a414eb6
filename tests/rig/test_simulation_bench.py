"""The bench: repeatable by seed, however calls are cut, and a board called by pointer."""

import itertools

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
