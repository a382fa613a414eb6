"""Every effect of the catalogue, found by discovery: adding a file is enough to be tested here."""

import inspect

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimation.campaign import Campaign
from estimation.channels import unit_of
from estimation.derived import measured_channels
from estimation.effects import Pointwise, UnknownEffectError, catalogue, effect
from estimation.filters import LowPass
from estimation.fitting import fit
from estimation.model import Model, Term, balance_channels
from estimation.recording import Recording

EVERY = pytest.mark.parametrize("kind", catalogue().values(), ids=catalogue())

TARGETS = {
    "motor": "proximal_torque_n_m",
    "gearbox": "gearbox_differential_rad",
    "cable": "proximal_torque_n_m",
    "stretch": "jaw_angle_rad",
    "grasp": "distal_torque_n_m",
    "joint": "joint_2_torque_n_m",
    "pitch": "pitch_torque_n_m",
    "yaw": "yaw_torque_n_m",
}


def at(parameter, place: float) -> float:
    """Return a value between the bounds of a shape parameter, on its scale."""
    low, high = parameter.lower, parameter.upper
    if parameter.linear:
        return low + place * (high - low)
    return low ** (1 - place) * high**place


SIZES = {
    "rad": 0.7,
    "rad/s": 2.0,
    "rad/s^2": 10.0,
    "N m": 0.15,
    "A": 0.3,
    "K": 8.0,
    "1": 0.5,
}
"""How far a channel of a unit moves on the rig."""


def motion(channels, seed: int, n: int = 300) -> dict[str, np.ndarray]:
    """Return channels that move as far and as fast as on the rig, with reversals."""
    random = np.random.default_rng(seed)
    time_s = np.arange(n) * 1e-3
    moved = {}
    for channel in channels:
        waves = sum(
            random.uniform(0.2, 0.6)
            * np.sin(2 * np.pi * random.uniform(0.3, 8) * time_s + random.uniform(0, 6))
            for _ in range(3)
        )
        size = SIZES.get(unit_of(channel), 0.1) * (35 if channel.startswith("motor_angle") else 1)
        moved[channel] = size * waves + (300.0 if channel.endswith("_k") else 0.0)
    starts = {"time_s": 0.0, "campaign_time_s": 700.0}
    return moved | {c: start + time_s for c, start in starts.items() if c in moved}


def walked(kind, inputs, shape) -> np.ndarray:
    """Return the columns as they come one sample at a time."""
    state = kind.start()
    samples = zip(*(values.tolist() for values in inputs.values()), strict=True)
    return np.array([kind.step(dict(zip(inputs, s, strict=True)), shape, state) for s in samples])


def by_role(kind, channels, seed: int) -> dict[str, np.ndarray]:
    moved = motion(channels.values(), seed)
    return {role: moved[channels[role]] for role in kind.roles}


@EVERY
@settings(max_examples=6)
@given(seed=st.integers(0, 1000), place=st.floats(0, 1))
def test_offline_columns_and_live_steps_agree_to_rounding(kind, seed, place):
    shape = [at(p, place) for p in kind.shape]
    inputs = by_role(kind, kind.roles, seed)
    columns = kind.columns(inputs, shape)
    assert columns.shape == (300, len(kind.amplitudes))
    size = max(1.0, float(np.abs(columns).max()))
    assert walked(kind, inputs, shape) == pytest.approx(columns, rel=1e-12, abs=1e-12 * size)


@EVERY
@pytest.mark.parametrize("place", [0.0, 0.4, 1.0])
def test_columns_stay_finite_on_constant_and_repeated_samples(kind, place):
    shape = [at(p, place) for p in kind.shape]
    moved = by_role(kind, kind.roles, seed=3)
    still = {role: np.repeat(values[:1], 50) for role, values in moved.items()}
    zeros = {role: np.zeros(50) for role in moved}
    twice = {role: np.repeat(values[:50], 2) for role, values in moved.items()}
    for inputs in (still, zeros, twice):
        columns = kind.columns(inputs, shape)
        assert np.isfinite(columns).all()
        assert walked(kind, inputs, shape) == pytest.approx(columns, rel=1e-12, abs=1e-12)


@EVERY
def test_a_sample_that_is_not_finite_spoils_no_later_one(kind):
    shape = [at(p, 0.4) for p in kind.shape]
    inputs = by_role(kind, kind.roles, seed=4)
    spoiled = {role: np.where(np.arange(300) == 100, np.nan, v) for role, v in inputs.items()}
    live, offline = walked(kind, spoiled, shape), kind.columns(spoiled, shape)
    assert np.isfinite(offline[101:]).all()
    assert live == pytest.approx(offline, rel=1e-12, abs=1e-12, nan_ok=True)


@EVERY
def test_an_effect_is_documented_and_its_parameters_have_units_and_bounds(kind):
    text = inspect.getdoc(type(kind)) or ""
    assert "Equation:" in text
    assert "Source:" in text
    for channel in kind.roles.values():
        unit_of(channel)
    for parameter in kind.amplitudes + kind.shape:
        assert parameter.lower < parameter.upper
        assert Term(kind).unit(parameter, "proximal_torque_n_m")
        assert parameter.description
    for parameter in kind.shape:
        assert np.isfinite([parameter.lower, parameter.upper]).all()
        assert parameter.linear or parameter.lower > 0  # searched by logarithm
        assert len(parameter.grid()) == parameter.points
    if len(kind.amplitudes) and kind.id != "sensor.offset":
        assert kind.told_apart_by


@EVERY
def test_a_search_may_enter_it_in_each_balance_it_names_with_units(kind):
    assert set(kind.balances) <= set(TARGETS)
    assert set(kind.balances.values()) <= {1, -1}
    for balance in kind.balances:
        for parameter in kind.amplitudes + kind.shape:
            assert Term(kind).unit(parameter, TARGETS[balance])


WIDE = LowPass(cutoff_hz=400.0)
"""A filter that leaves the data as they were made: smearing is another matter."""


BETWEEN_RUNS_S = 180.0
"""Time of a change in the campaign: when in the gap between two runs, they cannot tell."""


def typical(kind) -> list[float]:
    """Return a shape identifiable from these runs: off the grid, except for an encoder's order.

    That comes a whole number of times a turn. A width below the slowest speed is not identifiable.
    """
    if kind.id == "change.step.campaign":
        return [BETWEEN_RUNS_S, 3.0]
    if kind.family == "spring.end_stop":
        return [0.62 if kind.id == kind.family else -0.2]
    whole = {"sensor.encoder_inl": 11 / 31, "sensor.encoder_inl.harmonics": 6 / 15}.get(kind.id)
    return [at(p, whole or (0.7 if p.unit == "speed" else 0.37)) for p in kind.shape]


def excited(names, index: int) -> Recording:
    """Return a run that moves, reverses, rests and is loaded, with the measured channels asked."""
    random = np.random.default_rng(index)
    time_s = np.arange(6000) / 1000.0
    moving = np.clip(np.sin(2 * np.pi * time_s / 3.0), 0, 1) ** 2  # slow at times, at rest twice
    way = np.cumsum(moving) / 1000.0
    angle = (0.6 + 0.1 * index) * np.sin(2 * np.pi * (0.5 + 0.15 * index) * way)
    angle += 0.1 * np.sin(2 * np.pi * 1.7 * way + index)
    wave = 0.6 + 0.3 * np.sin(2 * np.pi * 0.8 * time_s + index) * np.sin(2 * np.pi * 2.3 * time_s)
    columns = {}
    for name in names:
        if name == "campaign_time_s":
            columns[name] = time_s + 100.0 * (1 + index)
        elif name == "motor_angle_rad":
            columns[name] = 35.0 * angle
        elif name in ("spindle_angle_rad", "jaw_angle_rad", "joint_2_angle_rad"):
            columns[name] = angle * {"s": 1.0, "j": 0.9}[name[0]]
        elif name.endswith(("_kg", "_v")):
            columns[name] = np.full(len(time_s), 0.2 * (1 + index))
        elif name.endswith("_k"):
            columns[name] = 300.0 + 10 * (1 - np.exp(-time_s / 3)) + 2 * index
        else:
            slow = np.sin(2 * np.pi * random.uniform(0.2, 1.5) * time_s + random.uniform(0, 6))
            columns[name] = SIZES[unit_of(name)] * (wave + 0.7 * slow - 0.5)
    return Recording(f"run-{index}", time_s, columns)


def made_by(kind, shape: list[float], runs: int = 3):
    """Return a declared model of one effect, its true values, and runs made by it."""
    balance, channels = next(iter(kind.balances), "calibration.test"), dict(kind.roles)
    angles = balance in ("gearbox", "stretch")
    target = "target_angle_rad" if angles else "tip_torque_n_m"
    declared = Model(
        "made", balance, target, (Term(kind, 1, channels),), low_pass=WIDE, run_offsets=False
    )
    measured = measured_channels(channels.values())
    recordings = [
        excited(measured, k).with_columns(**{target: np.zeros(6000)}) for k in range(runs)
    ]
    tables = [declared.terms[0].columns(balance_channels(declared, r), shape) for r in recordings]
    size = np.sqrt(np.mean(np.concatenate(tables) ** 2, axis=0))
    sides = np.where(
        [p.lower >= 0 for p in kind.amplitudes], 1.0, [(-1.0) ** k for k in range(len(size))]
    )
    most = np.array([min(1e9, p.upper) for p in kind.amplitudes])
    weights = sides * np.minimum(0.05 / size, most / 2)
    full = [
        r.with_columns(**{target: t @ weights}) for r, t in zip(recordings, tables, strict=True)
    ]
    names = [p.name for p in (*kind.amplitudes, *kind.shape)]
    return declared, dict(zip(names, [*weights, *shape], strict=True)), Campaign.of(full)


@EVERY
def test_a_fit_recovers_the_parameters_that_made_the_data(kind):
    declared, true, campaign = made_by(kind, typical(kind))
    (term,) = fit(declared, campaign, every=3, bootstrap=0).terms
    found = {name: value.value for name, value in term.values.items()}
    for parameter in kind.shape:
        if parameter.name == "order":
            assert found["order"] == pytest.approx(true["order"], rel=0.005)
    if true.get("since") == BETWEEN_RUNS_S:
        assert 106 < found.pop("since") <= 200
        del true["since"]
    assert found == pytest.approx(true, rel=0.05)


@pytest.mark.parametrize("order", [4.8, 4.83, 11.27])
def test_a_fit_reaches_the_narrow_peak_of_a_fractional_order(order):
    kind = effect("ripple.motor")
    declared, _, campaign = made_by(kind, [order])
    (term,) = fit(declared, campaign, every=3, bootstrap=0).terms
    assert term.values["order"].value == pytest.approx(order, rel=5e-4)


def test_a_delay_is_the_same_at_any_rate():
    delay = effect("sensor.delay")
    for rate_hz in (500, 1000, 10_000):
        time_s = np.arange(rate_hz) / rate_hz
        inputs = {"clock": time_s, "reading": np.sin(2 * np.pi * 3 * time_s)}
        (column,) = delay.columns(inputs, [0.0123]).T
        late = np.sin(2 * np.pi * 3 * (time_s - 0.0123)) - inputs["reading"]
        past = time_s > 0.0123
        assert column[past] == pytest.approx(late[past], abs=3e-4)


def test_units_of_parameters_follow_from_the_channels():
    friction = effect("friction.coulomb")
    term = Term(friction, channels={"speed": "jaw_velocity_rad_s"})
    (size,), (width,) = friction.amplitudes, friction.shape
    assert term.unit(size, "proximal_torque_n_m") == "N m"
    assert term.unit(width, "proximal_torque_n_m") == "rad/s"
    gain = effect("motor.torque_constant").amplitudes[0]
    assert Term(effect("motor.torque_constant")).unit(gain, "proximal_torque_n_m") == "N m/A"
    damping = effect("friction.viscous").amplitudes[0]
    assert Term(effect("friction.viscous")).unit(damping, "distal_torque_n_m") == "N m s/rad"
    assert Term(effect("friction.viscous")).unit(damping, "jaw_angle_rad") == "s"
    ripple = effect("ripple.motor")
    (order,) = ripple.shape
    assert Term(ripple).unit(order, "proximal_torque_n_m") == "1"
    screw = Term(ripple, channels={"motor_angle": "carriage_position_m"})
    assert screw.unit(order, "drive_force_n") == "rad/m"


def test_an_unknown_effect_names_the_nearest():
    with pytest.raises(UnknownEffectError, match=r"'friction\.(coulomb|viscous)_asymmetry'"):
        effect("friction.asym")
    with pytest.raises(UnknownEffectError, match=r"Did you mean 'friction\.coulomb'"):
        effect("friction.columb")


@pytest.mark.parametrize(
    "kind",
    [
        e
        for e in catalogue().values()
        if isinstance(e, Pointwise)
        and e.id.startswith("friction.")
        and all(p.lower == 0.0 for p in e.amplitudes)
    ],
    ids=lambda e: e.id,
)
@given(place=st.floats(0.1, 0.9), seed=st.integers(0, 2**16))
@settings(max_examples=20)
def test_friction_opposes_the_motion_against_loads_of_both_signs(kind, place, seed):
    random = np.random.default_rng(seed)
    inputs = {role: random.normal(0.0, 1.0, 200) for role in kind.roles}
    columns = kind.columns(inputs, [at(p, place) for p in kind.shape])
    assert np.all(columns * inputs["speed"][:, None] >= 0.0)
