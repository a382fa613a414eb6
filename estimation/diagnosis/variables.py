"""The variables that a residual may depend on: what they are called, and what each is read from."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from estimation.derived import measured_channels
from estimation.diagnosis.balance import Balance
from estimation.diagnosis.candidate import Candidate
from estimation.diagnosis.design import Run
from estimation.effects.roles import CABLE_ANGLE, CABLE_LOAD, MOTOR_LOAD
from estimation.effects.unknown_product import followed
from estimation.recording import FloatArray

CHANNELS = {
    "velocity_sign": "motor_velocity_rad_s",
    "velocity": "motor_velocity_rad_s",
    "spindle_angle": "spindle_angle_rad",
    "jaw_angle": "projected_jaw_angle_rad",
    "load": "projected_load_n_m",
    "current": "motor_current_a",
    "acceleration": "motor_acceleration_rad_s2",
    "time": "time_s",
    "motor_angle": "motor_angle_rad",
    "history": "spindle_angle_rad",
    "temperature": "motor_temperature_k",
    "wrist_pitch": "wrist_pitch_rad",
    "wrist_roll": "wrist_roll_rad",
}
"""Variables of a map, simplest first, and the channel each is taken from; of an arm see
`channels_of`."""

ARM_JOINTS = range(1, 8)

PROJECTED = {
    "proximal_torque_n_m": "projected_load_n_m",
    "jaw_angle_rad": "projected_jaw_angle_rad",
}
"""Measured channels, and what maps see of each: where it is the balance's own target, the declared
model's estimate stands in, since a sensor held against its own residual finds its own noise."""

SPEEDS = ("spindle_velocity_rad_s", "jaw_velocity_rad_s")
LOADS = ("proximal_torque_n_m", "distal_torque_n_m", MOTOR_LOAD, CABLE_LOAD)

BEHIND = {"motor": ("jaw_angle",), "gearbox": ("jaw_angle",), "cable": ("current",)}
"""Variables that reach a balance only through its load, and would stand for that load; and the
current in the cable's, where it tells the target: whatever the cable lacks is in it."""

TOGETHER = ({"spindle_angle", "jaw_angle", "motor_angle"}, {"load", "current"})
"""Variables of one rig that move together: its angles, and what the motor holds by its current."""

OF_SPEED = ("viscous", "viscous_asymmetry", "drag", "stribeck", "load_viscous")
"""Frictions that go with the speed, not with its sign alone."""

KNOTS = 7
ORDERS = 8
PLAYS = (0.05, 0.2, 0.6)
"""Widths of the play operators that stand for history, shares of the middle 98 % of the range."""


@dataclass(frozen=True)
class Basis:
    """Columns that stand for one variable.

    Attributes:
        variable: Name from `CHANNELS`.
        channel: Where it is taken from.
        low: First percentile over the runs that discover.
        high: 99th percentile.
    """

    variable: str
    channel: str
    low: float
    high: float

    def columns(self, run: Run) -> FloatArray:
        """Return the columns of one whole run, shape (n, k); their span holds the constant."""
        x = run.channels[self.channel]
        span = self.high - self.low
        if self.variable == "velocity_sign":
            sign = np.tanh(x / (0.02 * span))
            return np.column_stack([np.ones(len(x)), sign])
        if self.variable == "motor_angle":
            waves = [f(k * x) for k in range(1, ORDERS + 1) for f in (np.sin, np.cos)]
            return np.column_stack([np.ones(len(x)), *waves])
        if self.variable == "history":
            plays = [play(x, share * span) for share in PLAYS]
            return np.column_stack([np.ones(len(x)), *plays])
        knots = np.linspace(self.low, self.high, KNOTS)
        return np.column_stack([np.interp(x, knots, row) for row in np.eye(KNOTS)])


def play(x: FloatArray, width: float) -> FloatArray:
    """Return the play operator of a signal: it follows when pulled by more than half its width."""
    offset: FloatArray = np.empty(len(x))
    followed(x, max(0.5 * width, np.finfo(float).tiny), np.nan, offset)
    return offset


def variables_of(effect: Candidate, balance: Balance) -> tuple[str, ...]:
    """Return the variables of a named effect in a balance, from the channels it reads."""
    known = channels_of(balance.model.balance, balance.runs[0].channels)
    # of two on one channel the last but history
    by_channel = {channel: name for name, channel in known.items() if name != "history"}
    by_channel |= dict.fromkeys(SPEEDS, "velocity") | dict.fromkeys(LOADS, "load")
    by_channel |= dict.fromkeys(("jaw_angle_rad", CABLE_ANGLE), "jaw_angle")
    for _, channel in effect.channels:
        if "_drive_" in channel:  # a motor behind the coupling of an arm's wrist
            by_channel[channel] = "motor_angle" if channel.endswith("_angle_rad") else "velocity"
    found = [by_channel[channel] for _, channel in effect.channels if channel in by_channel]
    kind, _, name = effect.family.partition(".")
    if kind == "friction" and name not in OF_SPEED:
        found = ["velocity_sign" if variable == "velocity" else variable for variable in found]
    if kind == "hysteresis":
        found.append("history")
    return tuple(dict.fromkeys(found))


def within(variables: Sequence[str], others: Collection[str]) -> bool:
    """Say whether variables are no more than others, and what moves together with those."""
    known = {*others}.union(*(group for group in TOGETHER if group & {*others}))
    return {*variables} <= known


def channels_of(balance: str, there: Collection[str]) -> Mapping[str, str]:
    """Return the variables of a balance's maps, simplest first, and the channel of each.

    Args:
        balance: Balance id.
        there: Channels that the runs have; they tell whether a joint of an arm slides.
    """
    kind, _, number = balance.partition(".")
    if kind != "joint":
        return CHANNELS
    slides = {j for j in ARM_JOINTS if f"joint_{j}_position_m" in there}
    places = {j: f"joint_{j}_" + ("position_m" if j in slides else "angle_rad") for j in ARM_JOINTS}
    own = int(number)
    metres = own in slides
    speed = f"joint_{own}_velocity_" + ("m_s" if metres else "rad_s")
    return {
        "velocity_sign": speed,
        "velocity": speed,
        f"joint_{own}": places[own],
        "acceleration": f"joint_{own}_acceleration_" + ("m_s2" if metres else "rad_s2"),
        "time": "time_s",
        **{f"joint_{j}": places[j] for j in ARM_JOINTS if j != own},
        "history": places[own],
    }


def needed_channels(balance: str, measured: Sequence[str]) -> list[str]:
    """Return the channels of the variables that runs with these measured channels have."""
    variables = channels_of(balance, measured)
    wanted = [*PROJECTED, *(c for c in variables.values() if c not in PROJECTED.values())]
    return [c for c in wanted if set(measured_channels([c])) <= set(measured)]


def projection(balance: Balance) -> Callable[[Run], Run]:
    """Return what adds to a run's channels those that maps see in place of measured ones."""
    weights = balance.solve(balance.terms)

    def added(run: Run) -> Run:
        seen = {made: run.channels[own] for own, made in PROJECTED.items() if own in run.channels}
        if balance.model.target in PROJECTED:
            columns = np.column_stack([term.columns(run.channels) for term in balance.terms])
            seen[PROJECTED[balance.model.target]] = columns @ weights
        return replace(run, channels={**run.channels, **seen})

    return added


def bases(balance: Balance) -> list[Basis]:
    """Return the variables that the balance's residual may be mapped over, simplest first."""
    found = []
    variables = channels_of(balance.model.balance, balance.runs[0].channels)
    for variable, channel in variables.items():
        if variable in BEHIND.get(balance.model.balance, ()):
            continue
        if balance.model.target in (channel, *measured_channels([channel])):
            continue  # the target tells its own residual, noise and all
        if any(channel not in run.channels for run in balance.runs):
            continue
        values = np.concatenate([run.channels[channel] for run in balance.runs])
        low, high = (float(v) for v in np.percentile(values, [1, 99]))
        if high - low > 1e-12 * max(abs(high), abs(low), 1e-12):
            found.append(Basis(variable, channel, low, high))
    return found
