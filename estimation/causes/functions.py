"""Causes of unknown form: smooth functions of one or two variables and the direction of motion."""

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numba
import numpy as np

from estimation.causes.angles import travel_of
from estimation.causes.grids import contacts, direction_width, next_to
from estimation.causes.instruments import signal
from estimation.causes.layout import Layout
from estimation.causes.places import Place
from estimation.causes.run_signals import RunSignals
from estimation.derived import CAMPAIGN_TIME
from estimation.effects.friction_dwell import aged
from estimation.recording import FloatArray

KNOTS, KNOTS_ALONE, KNOTS_OF_FACTOR = 6, 14, 3
"""Knots of a variable's hat functions: of a function of two variables, of one alone, and of a load
that is a factor."""

PLAY = 0.06
"""Half width of the play operator that stands for history, share of the travel."""

ROLE_OF_VARIABLE = {
    "velocity_sign": "speed",
    "velocity": "speed",
    "history": "travel",
    "dwell": "speed",
    "turn": "position",
}
"""Variable to the role of an effect that its channel plays, where the names differ."""

Contact = tuple[float, float]
"""Time in which a contact at rest ages, s, and way that wears it, in the unit of its speed times
s."""

TURN = 2.0 * math.pi
LEAST_TURNS = 1.5
"""Turns of an angle in some run from which friction may repeat with every turn of it."""

MOST_VARIABLES = 3
"""Variables of one function, direction included."""

OF_CONTACT = {"velocity_sign", "dwell"}
"""Variables of the functions that show how fast a contact ages and wears."""

Form = float | Contact | bool | None
"""Width of a direction, contact of a dwell, and of a velocity next to a direction that its size
counts; nothing of other variables."""

LOOSE_PLACES = ("loss", "deflection", "actuator")


@dataclass(frozen=True)
class Function:
    """A smooth function of variables, acting at a place.

    Attributes:
        place: Where it acts.
        variables: Names of its variables, as a verdict lists them.
        knots: Places of each variable's hat functions; none of a direction.
        width: Speed over which friction changes its sign.
        contact: Of one of dwell: how fast the contact ages, and wears.
        as_read: Whether its variables are read, also where another sensor or the equation predicts
            them.
    """

    place: Place
    variables: tuple[str, ...]
    knots: tuple[tuple[float, ...], ...]
    width: float
    contact: Contact | None = None
    as_read: bool = False

    family = "unknown"
    is_declared = False

    @property
    def reads(self) -> tuple[str, ...]:
        """Channels that its variables come from, before instruments."""
        return tuple(_read(self.place, v) for v in self.variables if v != "time")

    def columns(self, run: RunSignals) -> Mapping[str, FloatArray]:
        """Return the tensor product of the variables' bases in every equation it enters."""
        made = {}
        for entry in self.place.enters:
            used = run.used[entry.equation]
            product = np.full((len(used), 1), entry.gain)
            for variable, knots in zip(self.variables, self.knots, strict=True):
                own = self._basis(run, variable, knots, entry.equation)[used]
                product = (product[:, :, None] * own[:, None, :]).reshape(len(used), -1)
            made[entry.equation] = product
        return made

    def _basis(
        self, run: RunSignals, variable: str, knots: tuple[float, ...], equation: str
    ) -> FloatArray:
        """Return a variable's hat functions on the run's grid, or one and the direction."""
        channel = _channel(run, self.place, variable, equation, self.as_read)
        form = _form(variable, self.variables, self.width, self.contact)
        values = _values_of(run, variable, channel, form)
        if variable == "velocity_sign":
            if "turn" in self.variables:  # what repeats in both directions is a ripple
                return values[:, None]
            return np.column_stack([np.ones(len(values)), values])
        return run.once(("hats", variable, channel, form, knots), lambda: _hats(values, knots))


def functions_at(layout: Layout, place: Place) -> Iterator[Function]:
    """Yield every smooth function that competes at a place."""
    if place.kind not in LOOSE_PLACES or any(e.order for e in place.enters):
        return
    known = variables_at(layout, place)
    chosen: list[tuple[str, ...]] = [(v,) for v in known]
    chosen += list(itertools.combinations(known, 2))
    if "velocity_sign" in known:
        chosen += [("velocity_sign", "turn")] * turns(layout, place)
        rest = [v for v in known if v not in ("velocity_sign", "velocity", "time")]
        chosen += [
            ("velocity_sign", *pair) for pair in itertools.combinations(rest, 2) if "load" in pair
        ]
    own = [v for v in ("position", "velocity", "acceleration") if v in known]
    for others in place.others:  # a joint carries the joints behind it, and is carried
        chosen += [(v,) for v in others]
        chosen += [*itertools.product(own, others), *((others[0], v) for v in others[1:])]
    if place.kind == "actuator" and len(place.equations) == 1:
        chosen = [v for v in chosen if "current" in v]  # the others are those of its equation
    if place.kind == "loss" and len(place.equations) > 1:
        # of its sensor's reading alone, it is an error of the sensor
        chosen = [v for v in chosen if v != ("load",)]
    tried = _contacts(layout, place) if "dwell" in known else []
    for variables in chosen:
        if "dwell" not in variables:
            yield _function(layout, place, variables)
            continue
        alone = {*variables} <= OF_CONTACT
        for contact in tried if alone else [_middle(tried)]:
            yield _function(layout, place, variables, contact)


def at_other_contacts(layout: Layout, function: Function) -> Iterator[Function]:
    """Yield a function of dwell whose contact ages or wears between the values that were tried."""
    if function.contact is None or not {*function.variables} <= OF_CONTACT:
        return
    least = np.min(_contacts(layout, function.place), axis=0)
    for contact in next_to(function.contact):
        if np.all(contact >= least):  # one without a memory is a curve over speed
            yield _function(layout, function.place, function.variables, contact)


def _contacts(layout: Layout, place: Place) -> list[Contact]:
    return contacts(layout, {"speed": place.roles["speed"][0], "clock": "time_s"})


def _middle(of: Sequence[Contact]) -> Contact:
    """Return the geometric mean of times and of ways."""
    time_s, way = np.exp(np.mean(np.log(of), axis=0))
    return float(time_s), float(way)


def _function(
    layout: Layout, place: Place, variables: tuple[str, ...], contact: Contact | None = None
) -> Function:
    width = direction_width(layout, place) if "speed" in place.roles else 0.0
    counts = _counts(variables)
    forms = {v: _form(v, variables, width, contact) for v in variables}
    knots = tuple(_knots(layout, place, v, forms[v], counts[v]) for v in variables)
    return Function(place, variables, knots, width, contact)


def _form(variable: str, variables: Sequence[str], width: float, contact: Contact | None) -> Form:
    """Return the part of a form that a variable's values depend on.

    Any function of a velocity is one of its size and its direction, so that its knots are twice as
    dense at the same number of columns.
    """
    if variable == "velocity" and "velocity_sign" in variables:
        return True
    return {"velocity_sign": width, "dwell": contact}.get(variable)


def variables_at(layout: Layout, place: Place) -> list[str]:
    """Return the variables a cause at a place may depend on, simplest first."""
    found = []
    if "speed" in place.roles and direction_width(layout, place):
        found += ["velocity_sign", "velocity"]
    others = ["position", "load", "current", "acceleration", "history", "dwell", "temperature"]
    if place.kind != "loss":
        others.remove("acceleration")
    found += [v for v in others if ROLE_OF_VARIABLE.get(v, v) in place.roles]
    if "dwell" in found and not _contacts(layout, place):
        found.remove("dwell")  # no run rests: it is a function of the velocity
    return [*found, "time"]


def turns(layout: Layout, place: Place) -> bool:
    """Whether a place has a shaft that turns often enough to repeat anything."""
    angle = place.roles.get("position", ("",))[0]
    return angle.endswith("_angle_rad") and travel_of(layout, angle) > LEAST_TURNS * TURN


def names(place: Place, variables: Sequence[str]) -> tuple[str, ...]:
    """Return the names under which a function's variables are reported."""
    by_channel = ("position", "turn", *itertools.chain(*place.others))
    found = (name_of_channel(_read(place, v)) if v in by_channel else v for v in variables)
    return tuple(dict.fromkeys(found))


def name_of_channel(channel: str) -> str:
    """Return the name of an axis' motion in a finding: its channel without the unit."""
    endings = ("_rad_s2", "_m_s2", "_rad_s", "_m_s", "_rad", "_m")
    return channel.removesuffix(next((e for e in endings if channel.endswith(e)), ""))


def _read(place: Place, variable: str) -> str:
    """Return the channel that a variable of a place comes from; other axes' are channels."""
    channels = place.roles.get(ROLE_OF_VARIABLE.get(variable, variable), (variable,))
    return channels[0]


def _values_of(run: RunSignals, variable: str, channel: str, form: Form) -> FloatArray:
    """Return a variable's values on the run's grid, shape (n,)."""
    key = variable, channel, form
    return run.once(key, lambda: _worked_out(run, variable, channel, form))


def _channel(
    run: RunSignals, place: Place, variable: str, equation: str, as_read: bool = False
) -> str:
    """Return the channel that a variable's values come from in an equation."""
    if variable == "time":
        return CAMPAIGN_TIME
    return signal(run, _read(place, variable), equation, as_read)


def _worked_out(run: RunSignals, variable: str, name: str, form: Form) -> FloatArray:
    whole = run.channels[name]
    if form is True:
        return np.abs(run.on_grid(name))
    if isinstance(form, float):
        return np.tanh(run.on_grid(name) / form)
    if variable == "history":
        # half the difference to the same backwards in time: the loop, without what noise follows
        half = PLAY * float(np.ptp(whole)) or 1.0
        return 0.5 * (_play(whole[::-1], half)[::-1] - _play(whole, half))[run.grid]
    if isinstance(form, tuple):
        return np.asarray(_ages(whole, 1.0 / run.rate_hz, *form)[run.grid])
    if variable == "turn":
        return np.asarray(np.mod(run.on_grid(name), TURN))
    return run.on_grid(name)


def _counts(variables: Sequence[str]) -> dict[str, int]:
    """Return the number of knots of each variable; next to another one, load is a factor."""
    others = {*variables} - {"velocity_sign"}
    if len(others) == 1:
        return dict.fromkeys(variables, KNOTS_ALONE)
    if "load" in others:
        return dict.fromkeys(variables, KNOTS_ALONE) | {"load": KNOTS_OF_FACTOR}
    return dict.fromkeys(variables, KNOTS)


def _knots(
    layout: Layout, place: Place, variable: str, form: Form, count: int
) -> tuple[float, ...]:
    """Return the knots of a variable, evenly over the range of its values."""
    if variable == "velocity_sign":
        return ()
    channels = [_channel(run, place, variable, place.home) for run in layout.runs]
    key = variable, channels[0], form
    if key not in layout.ranges:
        pairs = zip(layout.runs, channels, strict=True)
        inside = [_values_of(run, variable, channel, form) for run, channel in pairs]
        ends = np.array([np.percentile(x, [1, 99]) for x in inside])
        layout.ranges[key] = float(ends[:, 0].min()), float(ends[:, 1].max())
    low, high = layout.ranges[key]
    return tuple(map(float, np.linspace(low, high if high > low else low + 1.0, count)))


def _hats(values: FloatArray, knots: tuple[float, ...]) -> FloatArray:
    """Return hat functions of values at knots, shape (n, knots)."""
    place = np.interp(values, knots, np.arange(len(knots)))
    return np.asarray(np.maximum(0.0, 1.0 - np.abs(place[:, None] - np.arange(len(knots)))))


@numba.njit(cache=True)
def _play(x: FloatArray, half: float) -> FloatArray:
    """Return the play operator: it follows when pulled by more than half its width."""
    out = np.empty(len(x))
    at = x[0]
    for i in range(len(x)):
        at = min(max(at, x[i] - half), x[i] + half)
        out[i] = at
    return out


@numba.njit(cache=True)
def _ages(speed: FloatArray, period_s: float, time_s: float, way: float) -> FloatArray:
    """Return the state of a contact at each sample, 0 to 1; a run starts after a long rest."""
    out = np.empty(len(speed))
    state = 1.0
    for i in range(len(speed)):
        out[i] = state = aged(state, speed[i], period_s, time_s, way) if i else 1.0
    return out
