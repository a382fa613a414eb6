"""Sensors that fail while the rig moves, held by the firmware core; a share of soak and fuzz."""

import ctypes
import math
from pathlib import Path

import numpy as np
import pytest

from benchmarks.reliability import dead_encoders, fuzz
from benchmarks.reliability.encoder_faults import (
    FAULTS,
    JAW,
    MOTOR,
    PER_RAD,
    SPINDLE,
    frozen,
    losing,
    ride,
    sound,
)
from benchmarks.reliability.faults import SENSOR_FAULTS, inject
from benchmarks.reliability.targets import TARGETS
from drivers.registry import fakes
from drivers.teensy.control import Controllers
from drivers.teensy.core import TICK, CoreGuard, FirmwareBoard
from drivers.teensy.protocol import STATUS_LIMIT_TRIPPED, Kind, Result, Trip
from drivers.transport.faulty import Fault
from rig.configuration.config import load_config
from rig.machines.choose import machine_of
from rig.protocols.motion import motion_of
from rig.protocols.protocol import RunPlan, load_protocol
from rig.simulation.bench import SimulatedBench
from rig.simulation.hidden import draw
from rig.simulation.parameters import REFERENCE_GAINS, PlantParameters, vary
from rig.simulation.places import SPINDLE_ANGLE
from tests.drivers.raw_host import RawHost

pytestmark = pytest.mark.integration

BEYOND_RAD = math.radians(5.0)


def test_a_sound_rig_trips_over_nothing(library):
    assert ride(sound, library=library)[2] is Trip.NONE


@pytest.mark.parametrize("name", list(FAULTS))
def test_a_sensor_that_fails_ends_the_motion(library, name):
    fault, codes = FAULTS[name]
    rig, samples, trip = ride(fault, library=library)
    tripped = (samples["status"] & STATUS_LIMIT_TRIPPED) != 0
    assert tripped.any()
    assert trip in codes
    assert (samples["command_e4"][tripped] == 0).all()
    assert np.abs(rig.angles).max() < 3.0


@pytest.mark.parametrize("fault_tick", [100, 300])
@pytest.mark.parametrize("columns", [(SPINDLE,), (SPINDLE, JAW), (MOTOR, SPINDLE, JAW)])
def test_a_dead_encoder_near_the_end_of_travel_lets_the_spindle_hardly_beyond(
    library, columns, fault_tick
):
    fault = frozen(*columns, since=fault_tick)
    rig, _, trip = ride(fault, start_rad=2.9, stop_rad=2.99, library=library)
    assert trip is not Trip.NONE
    assert np.abs(rig.angles).max() < 3.0 + BEYOND_RAD


def test_two_encoders_that_lose_counts_alike_let_the_spindle_hardly_beyond(library):
    for start_rad in (1.7, 2.0, 2.3):
        fault = losing(MOTOR, SPINDLE)
        rig, _, _ = ride(fault, 8000, start_rad=start_rad, stop_rad=2.99, library=library)
        assert np.abs(rig.angles).max() < 3.0 + BEYOND_RAD


def counts_of(seed: int, plan: RunPlan) -> np.ndarray:
    """Counts of a run of a drawn rig that nothing watches."""
    motion = motion_of(plan, float(plan.target_angle_rad[0]))
    angle_rad, load_a = motion.setpoints
    asked = np.column_stack((angle_rad * PER_RAD[SPINDLE], 1e3 * load_a))
    setpoints = np.round(asked).astype(np.int32)
    plant = vary(PlantParameters(), seed, 0.15)
    bench = SimulatedBench(plant, effects=[draw(seed)], seed=seed, start_count=int(setpoints[0, 0]))
    return bench.advance(setpoints, Controllers.fresh(REFERENCE_GAINS))


@pytest.mark.parametrize("seed", [13, 17, 24, 26, 36])
def test_a_rig_that_is_sound_but_not_as_declared_has_no_dead_encoder(library, seed):
    """A winding that warms, viscous gears and a slow torque sensor."""
    config = load_config(Path("reference"))
    machine = machine_of(config)
    limits = machine.board_limits(config, config.calibration_set())
    plans = [*load_protocol("reference").plans()[8::10], *load_protocol("diagnosis").plans()]
    for plan in plans:
        guard = CoreGuard(machine.profile, machine.gains(config), limits, library)
        rows = counts_of(seed, plan)[:, :6]
        assert guard.first_crossing(np.ascontiguousarray(rows), np.ones(len(rows)))[1] == Trip.NONE


@pytest.mark.parametrize("speed_rad_s", [0.05, 0.6])
@pytest.mark.parametrize("sense", [-1, 1])
def test_a_rig_at_rest_whose_encoders_are_dead_trips_before_it_breaks_away(
    library, speed_rad_s, sense
):
    """The gearhead is elastic: what the sensor finds has turned the motor."""
    config = load_config(Path("reference"))
    machine = machine_of(config)
    limits = machine.board_limits(config, config.calibration_set())
    bench = SimulatedBench(start_count=round(-0.9 * PER_RAD[SPINDLE]))
    board = FirmwareBoard(dead_encoders.DeadFrom(bench, 500), library=library)
    host = RawHost(board, machine.profile, machine.gains(config))
    host.command(Kind.START)
    assert host.arm(limits) is Result.OK
    angle_rad = -0.9 + sense * speed_rad_s * np.clip(np.arange(3000) * 1e-3 - 0.6, 0, None)
    for block in np.split(np.round(angle_rad * PER_RAD[SPINDLE]).astype(np.int32), 60):
        host.setpoints(block, [0] * 50)
        host.run(50)
    assert host.trip().code is Trip.ENCODER_FROZEN
    assert abs(bench.state[SPINDLE_ANGLE] + 0.9) < BEYOND_RAD


# of 320 drawn motions: the farthest beyond before the board asked its encoders, and a coasting one
@pytest.mark.parametrize(("seed", "slow"), [(9, True), (65, True), (102, True), (1089, False)])
def test_encoders_that_all_die_on_the_way_let_the_spindle_hardly_beyond(library, seed, slow):
    dead = dead_encoders.ride(seed, slow, library=library)
    assert dead.trip is Trip.ENCODER_FROZEN
    assert dead.beyond_rad < BEYOND_RAD
    assert dead_encoders.ride(seed, slow, dead=False, library=library).trip is Trip.NONE


class SmallGrasper:
    """Three motors behind gearheads; the first decoder counts the third's phase A as its own."""

    def __init__(self, shares_an_input: bool) -> None:
        self.angle_rad, self._speed, self._current = np.zeros(3), np.zeros(3), np.zeros(3)
        self.farthest_rad = np.zeros(3)
        self._shares = shares_an_input
        self._noise = np.random.default_rng(0)
        self._phases, self._count = 0, 0

    def advance_with_board(self, ticks, tick_address, board_address, tick_us):
        tick = TICK(tick_address)
        outputs = (ctypes.c_int32 * 3)()
        for k in range(ticks):
            motor = np.floor(self.angle_rad * 2048 * 66 / math.tau).astype(int)
            if self._shares:
                motor[0] = self._decoded(int(motor[2]), int(motor[0]))
            noise = self._noise.integers(-4, 5, 6)
            counts = [*motor, *(1000 * self._current + noise[:3]).astype(int), *(100 + noise[3:])]
            given = (ctypes.c_int32 * 9)(*map(int, counts))
            tick(board_address, (tick_us + 500 * k) % 2**32, given, outputs)
            self._current = 2e-4 * np.array(outputs[:])
            for _ in range(5):
                friction = 4e-3 * np.tanh(self._speed / 0.02) + 2e-2 * self._speed
                torque = 66 * 14.6e-3 * self._current - friction
                self._speed += torque / (66**2 * 2.7e-7) * 1e-4
                self.angle_rad += self._speed * 1e-4
            self.farthest_rad = np.maximum(self.farthest_rad, np.abs(self.angle_rad))

    def _decoded(self, a_count: int, b_count: int) -> int:
        phases = (a_count >> 1 & 1) << 1 | ((b_count + 1) >> 1 & 1)
        step = (0, -1, 1, 0, 1, 0, 0, -1, -1, 0, 0, 1, 0, 1, -1, 0)[self._phases << 2 | phases]
        self._phases, self._count = phases, self._count + step
        return self._count


@pytest.mark.parametrize("shares_an_input", [False, True])
def test_a_grasper_with_a_wrong_decoder_input_stops(library, shares_an_input):
    config = load_config(Path("grasper"))
    machine = machine_of(config)
    profile = machine.profile
    limits = machine.board_limits(config, config.calibration_set())
    rig = SmallGrasper(shares_an_input)
    board = FirmwareBoard(rig, library=library, profile=profile)
    host = RawHost(board, profile, machine.gains(config))
    host.command(Kind.START)
    board.advance(1)
    assert host.arm(limits) is Result.OK
    for block in range(60):
        move = np.clip((np.arange(50) + 50 * block) / 2000, 0, 1) * 0.2 * 2048 * 66 / math.tau
        host.setpoints(*[move.astype(np.int32)] * 3)
        host.run(50)
    samples = host.samples()
    tripped = (samples["status"] & STATUS_LIMIT_TRIPPED) != 0
    assert tripped.any() == shares_an_input
    assert (rig.farthest_rad < [1.4, 1.0, 1.0]).all()


@pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.name)
def test_a_decoder_refuses_or_reads_right_whatever_comes(target):
    tally = fuzz.Tally()
    fuzz.run_block(target, 10**6, tally, size=150)
    assert tally.failures == []
    assert tally.inputs == 150
    good = [target.run(seed) for seed in target.seeds()]
    assert all(good), "an unharmed input is not accepted"


def test_faults_of_every_kind_are_detected_and_end_safe_in_time(library):
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
