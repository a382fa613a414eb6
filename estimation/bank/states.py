"""The states an estimate is made of, and the products of them that get a weight.

One instant of the drive is a row of filtered channels. The states are computed from it, numbers of
order one; then products of states, each with its own weight; and the ripple, a Fourier series in
the spindle's angle whose amplitudes depend on load and speed. Where the wrist moves, a second,
slower series has amplitudes that depend on its pose: the cables rub at other places in every pose.
No channel uses more than the last `estimation.derived.TRAVEL_WINDOW_S`.

States, t the motor's travel since the lowest angle of that window:

- `q` spindle angle, `c` surrogate of the load, `v` speed, `a` acceleration, `i` inverse speed, `d`
  difference of the surrogate to its highest value of the window;
- `l5` to `l480`: the load that many ms earlier. Friction that varies with teeth and balls is in
  the present load, and less in the load on other teeth; `b5` to `b480`: the acceleration then;
- `k1` to `k4`: min(t, r) / r, r = 1 to 4 rad, and `n1` to `n3`: the same with r in proportion to
  the load. Both are Prandtl's stop operators after a reversal, the elements of a Maxwell-slip model
  of presliding friction; the second ones for friction that grows with the cable's tension. A drive
  that has not reversed within the window has slid, at any speed, so t grows when the reversal is
  older than the window;
- `h2`, `h4`: increase of the load since the motor reversed, while t is below 2 and 4 rad: a jaw
  that sticks takes up the drive's changes;
- `p` pose of the wrist, where there is one.

Sources: F. Al-Bender, V. Lampaert, J. Swevers, "The generalized Maxwell-slip model", IEEE
Transactions on Automatic Control 50 (2005); orders of the ripple: the gearhead's meshes and their
side bands lie between 0.2 and 5 a motor turn.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numba import njit
from numpy.typing import NDArray

from estimation.bank.fitting import Shape
from estimation.derived import TRAVEL_WINDOW_S, ago_of, fall_of, rise_of
from estimation.plant_file import shipped_plant
from estimation.recording import FloatArray

GEAR_RATIO = next(
    joint.ratio for joint in shipped_plant("reference").transmissions if joint.ratio is not None
)
"""Motor turns a spindle turn of the reference rig: it scales the states of speed and ripple."""

LAGS_MS = (5, 10, 20, 40, 80, 150, 300, 480)
LAGS = tuple(f"l{ms}" for ms in LAGS_MS)
PUSHES = tuple(f"b{ms}" for ms in LAGS_MS)
RISES = ("h2", "h4")
STATES = (
    "q", "c", "v", "a", "i", "d", "k1", "k2", "k3", "k4", "n1", "n2", "n3", "p",
    *RISES, *LAGS, *PUSHES,
)  # fmt: skip
CLIPS = ("k1", "k2", "k3", "k4", "n1", "n2", "n3")

LOAD_SCALES = {"motor_command_ratio": 0.1, "motor_current_a": 0.21, "proximal_torque_n_m": 0.1}
"""Middle of each surrogate's range on the reference rig, in its own unit."""

POSITION_CENTRE_RAD, POSITION_SCALE_RAD = -0.5, 0.5
ACCELERATION_SCALE_RAD_S2 = 1000.0
SLOWEST_RAD_S = 0.2
LIGHTEST = 0.2
"""Load below which the travel of a load-proportional state shrinks no further."""

LEAVING_S, SLID_RAD = 0.1, 20.0
"""Over the last part of the window the travel since a turn grows by so much: the drive has slid."""

JUDGED = 4
"""Channels, the first ones and the pose, whose range an estimate is valid in; the others follow."""

ORDERS = 29
RIPPLE_STEP = 0.17
"""Orders of the ripple per motor turn: 29 multiples of 0.17. A stroke of the rig is 6 turns, so
orders closer together are indistinguishable."""

WRIST_ORDERS, WRIST_PERIOD_RAD = 20, 3.3
"""Orders of the wrist's series and its period, a little more than the range of all jaw stops."""

WRIST_POWERS = 5
"""Powers of the pose, from 0, in its amplitudes: as many as the public data has poses."""

STIFFER = 3.0
"""Each further factor of a product, or power of the pose, makes its weight so much stiffer."""

Product = tuple[str, ...]


def _grid(positions: int, loads: int) -> list[Product]:
    return [("q",) * i + ("c",) * j for i in range(positions + 1) for j in range(loads + 1)]


NEUTRAL: list[Product] = [
    *_grid(3, 2), ("c",) * 3, ("q",) + ("c",) * 3, ("q",) * 4, ("q",) * 4 + ("c",), ("q",) * 5,
    ("v",), ("v", "v"), ("c", "v"), ("c", "c", "v"), ("q", "v"), ("i",), ("c", "i"),
    ("a",), ("q", "a"), ("v", "a"), *[(push,) for push in PUSHES],
    ("d",), ("q", "d"), ("d", "d"),
    *[(lag,) for lag in LAGS],
    *[(lag, state) for lag in ("l20", "l80", "l300") for state in ("q", "v")],
    *[(rise, *rest) for rise in RISES for rest in [(), ("q",), ("c",), (rise,)]],
    *[
        product
        for clip in CLIPS
        for product in [
            (clip,), (clip, "c"), (clip, "q"), (clip, "q", "c"), (clip, "q", "q"), (clip, "v"),
            (clip, "a"), (clip, "c", "c"),
        ]
    ],
]  # fmt: skip
"""Products for any pose."""

POSED: list[Product] = [
    ("p",) * power + rest
    for power in (1, 2, 3, 4)
    for rest in [
        *_grid(2, 1), ("c", "c"), ("q", "c", "c"), ("q", "q", "q"), ("v",), ("i",), ("a",),
        ("c", "v"), ("c", "i"), ("q", "v"), ("d",),
        *[(clip, *load) for clip in ("k1", "k2", "k4", "n1", "n2") for load in [(), ("c",)]],
    ]
]  # fmt: skip
"""Products that a wrist's pose adds."""

RUNS: list[Product] = [
    (), ("c",), ("q",), ("v",), ("c", "c"), ("i",), ("c", "i"), ("c", "v"),
]  # fmt: skip
"""Products that the means of runs are fitted with."""

RIPPLE = "ripple"

EFFECTS: dict[str, tuple[str, ...]] = {
    "speed": ("v", "i"),
    "acceleration": ("a", *PUSHES),
    "acceleration of the last 0.5 s": PUSHES,
    "load of the last 0.5 s": LAGS,
    "fall of the load": ("d",),
    "rise of the load after a reversal": RISES,
    "hysteresis": CLIPS,
    RIPPLE: (),
}
"""Effects that an ablation removes, and their states; products of these states are removed too."""


@dataclass(frozen=True)
class Bank:
    """Which channels are read and which products are made of them."""

    # channel that represents the load; a key of `LOAD_SCALES`
    surrogate: str = "motor_command_ratio"
    pose: str = ""  # channel of the wrist's pose in rad, or empty
    without: tuple[str, ...] = ()  # effects left out, keys of `EFFECTS`

    @property
    def channels(self) -> tuple[str, ...]:
        """Channels of a row, measured or derived; the judged ones first."""
        load = self.surrogate
        now = ("spindle_angle_rad", load, "motor_velocity_rad_s", "motor_acceleration_rad_s2")
        turn = ("motor_travel_rad", "motor_turned_s", fall_of(load), rise_of(load))
        past = [ago_of(channel, ms) for channel in (load, now[3]) for ms in LAGS_MS]
        return (*now, *((self.pose,) if self.pose else ()), *turn, *past)

    @property
    def judged(self) -> int:
        """Number of channels, from the first, in whose range an estimate is valid."""
        return JUDGED + bool(self.pose)

    @cached_property
    def products(self) -> tuple[Product, ...]:
        """Products in order; each one but the first, the constant, is an earlier one by a state."""
        absent = {state for effect in self.without for state in EFFECTS[effect]}
        wanted = [*NEUTRAL, *(POSED if self.pose else [])]
        return closed(product for product in wanted if absent.isdisjoint(product))

    @cached_property
    def tables(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Parent and state of each product: its value is theirs multiplied."""
        place = {product: k for k, product in enumerate(self.products)}
        parents = [place[product[:-1]] for product in self.products[1:]]
        states = [STATES.index(product[-1]) for product in self.products[1:]]
        return np.array([0, *parents]), np.array([0, *states])

    @property
    def orders(self) -> int:
        """Orders of the ripple."""
        return 0 if RIPPLE in self.without else ORDERS

    @property
    def wrist_orders(self) -> int:
        """Orders of the wrist's series."""
        return WRIST_ORDERS if self.pose else 0

    @property
    def size(self) -> int:
        """Number of weights."""
        return len(self.products) + 6 * self.orders + 2 * WRIST_POWERS * self.wrist_orders

    @cached_property
    def shape(self) -> Shape:
        """Properties of the columns that a fit needs."""
        factors = [len(product) for product in self.products]
        factors += self.orders * [1, 1, 2, 2, 2, 2]
        factors += self.wrist_orders * [1 + power for power in range(WRIST_POWERS) for _ in "sc"]
        stiffness = STIFFER ** (np.array(factors) - 1.0)
        between = [self.products.index(p) for p in RUNS if p in self.products]
        return Shape(np.asarray(stiffness), np.array(between))

    def design(self, rows: FloatArray) -> FloatArray:
        """Return the columns of the weights, shape (n, size), for rows of channels, (n, channels).

        A value that is not finite makes its row so.
        """
        design = np.empty((len(rows), self.size))
        fill(
            np.ascontiguousarray(rows),
            LOAD_SCALES[self.surrogate],
            *self.tables,
            self.orders,
            self.wrist_orders,
            design,
        )
        return design


def held_within(bank: Bank, rows: FloatArray, ranges: FloatArray) -> FloatArray:
    """Return rows with the angle, and the pose, moved to the nearest ones fitted, (n, channels).

    A polynomial of the angle carried beyond them grows to many times the largest torque. `ranges`
    are the lowest and highest value of each judged channel fitted on, shape (2, judged).
    """
    held = rows.copy()
    for channel in (0, *range(JUDGED, bank.judged)):
        held[:, channel] = np.clip(rows[:, channel], *ranges[:, channel])
    return held


def closed(products: Iterable[Product]) -> tuple[Product, ...]:
    """Return products after all those they are made of, the constant first, none twice."""
    found: dict[Product, None] = {(): None}
    for product in products:
        for length in range(1, len(product) + 1):
            found.setdefault(product[:length])
    return tuple(found)


@njit(cache=True)
def fill(
    rows: FloatArray,
    load_scale: float,
    parents: NDArray[np.int64],
    factors: NDArray[np.int64],
    orders: int,
    wrist_orders: int,
    design: FloatArray,
) -> None:
    """Write the products and both series of each row of channels."""
    lags = len(LAGS_MS)
    state = np.zeros(16 + 2 * lags)
    posed = rows.shape[1] - (JUDGED + 4 + 2 * lags)
    since = JUDGED + posed  # the first channel of the turn and the past
    count = len(parents)
    for n in range(len(rows)):
        angle, surrogate, speed = rows[n, 0], rows[n, 1], rows[n, 2] / GEAR_RATIO
        load = surrogate / load_scale
        left = (rows[n, since + 1] - TRAVEL_WINDOW_S + LEAVING_S) / LEAVING_S
        travel = rows[n, since] + SLID_RAD * max(left, 0.0)
        state[0] = (angle - POSITION_CENTRE_RAD) / POSITION_SCALE_RAD
        state[1] = load - 1.0
        state[2] = speed - 1.0
        state[3] = rows[n, 3] / ACCELERATION_SCALE_RAD_S2
        state[4] = 1.0 / max(abs(speed), SLOWEST_RAD_S)
        state[5] = rows[n, since + 2] / load_scale
        for r in range(4):
            state[6 + r] = min(travel / (r + 1.0), 1.0) - 0.5
        for r in range(3):
            state[10 + r] = min(travel / ((r + 1.0) * max(load, LIGHTEST)), 1.0) - 0.5
        if posed:
            state[13] = rows[n, JUDGED]
        for r in range(2):
            sticking = max(1.0 - travel / (2.0 * r + 2.0), 0.0)
            state[14 + r] = rows[n, since + 3] / load_scale * sticking
        past = rows[n, since + 4 :]
        for lag in range(lags):
            state[16 + lag] = past[lag] / load_scale - 1.0
            state[16 + lags + lag] = past[lags + lag] / ACCELERATION_SCALE_RAD_S2
        out = design[n]
        out[0] = 1.0
        for k in range(1, count):
            out[k] = out[parents[k]] * state[factors[k]]
        at = count
        turn = GEAR_RATIO * RIPPLE_STEP * angle
        sine, cosine = np.sin(turn), np.cos(turn)
        s, c = 0.0, 1.0
        for _ in range(orders):
            s, c = s * cosine + c * sine, c * cosine - s * sine
            out[at], out[at + 1] = s, c
            out[at + 2], out[at + 3] = s * state[1], c * state[1]
            out[at + 4], out[at + 5] = s * state[2], c * state[2]
            at += 6
        turn = 2.0 * np.pi / WRIST_PERIOD_RAD * angle
        sine, cosine = np.sin(turn), np.cos(turn)
        s, c = 0.0, 1.0
        for _ in range(wrist_orders):
            s, c = s * cosine + c * sine, c * cosine - s * sine
            amplitude = 1.0
            for _ in range(WRIST_POWERS):
                out[at], out[at + 1] = amplitude * s, amplitude * c
                amplitude *= state[13]
                at += 2
