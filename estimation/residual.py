"""The residual of a fitted model on a campaign, and the largest structure left in it.

This is a screening, not a diagnosis. It shows that the residual is structured and which variable it
depends on; it does not identify an effect. Naming an effect needs the search over
the catalogue with its own statistics: that search takes the same inputs (a fitted `Model`, a
`Campaign`) and starts from the same `residuals`.

The unit of evidence is the run: a smooth function of a variable is fitted to the residual of all
other runs and scored on the run left out. Each run's mean is removed first where run offsets
are a nuisance in the model; else the mean over all runs is.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from estimation.campaign import Campaign
from estimation.channels import unit_of
from estimation.derived import measured_channels, zero_phase_channels
from estimation.errors import EstimationError
from estimation.model import Model, estimate, settled
from estimation.recording import FloatArray, Recording

VARIABLES: dict[str, str] = {
    "velocity_sign": "spindle_velocity_rad_s",
    "velocity": "spindle_velocity_rad_s",
    "spindle_angle": "spindle_angle_rad",
    "motor_angle": "motor_angle_rad",
    "load": "proximal_torque_n_m",
    "current": "motor_current_a",
    "acceleration": "spindle_acceleration_rad_s2",
    "time": "time_s",
}
"""Variables of the screening, and the channel of each."""

SURROGATES = 19  # Number of shifted residuals behind `chance_fraction`
BINS = 24  # Bins of a map; its range is that of the middle 98 % of the samples
ORDERS = 12  # Highest order of a ripple that is looked for, per turn of the motor
REST_RAD_S = 0.02  # Spindle speed below which the direction of motion counts as none, rad/s
SIMPLER_SHARE = 0.9
"""The direction is ranked before the speed when it explains this share of what the speed does."""

RATE_HZ = 100.0
"""Rate the residual is thinned to; structure in a residual is slow, and so is its noise."""


class ResidualError(EstimationError):
    """A residual cannot be screened."""


@dataclass(frozen=True)
class RunResidual:
    """The residual of a model in one run.

    Attributes:
        run: The run's filtered channels: the model's, its target and the variables'.
        estimate: The model's estimate, shape (n,), in the target's unit.
        values: Target less estimate, shape (n,).
    """

    run: Recording
    estimate: FloatArray
    values: FloatArray


@dataclass(frozen=True, slots=True)
class Structure:
    """Dependence of a residual on one variable.

    Attributes:
        variable: Name of the variable, see `VARIABLES`.
        explained_fraction: Share of the residual's variance that a function of this variable,
            fitted on the other runs, explains; negative when the map makes it worse.
        chance_fraction: The largest such share that any variable reached on residuals shifted in
            time and flipped run by run. A share that is not well above it is not significant.
        amplitude: Size of the function: half its spread between the 5th and the 95th percentile of
            the samples, or the amplitude of the ripple.
        unit: Unit of the amplitude.
        detail: Where it is largest, in words.
    """

    variable: str
    explained_fraction: float
    chance_fraction: float
    amplitude: float
    unit: str
    detail: str

    @property
    def stands_out(self) -> bool:
        """Whether the share is well above chance and above one part in a hundred."""
        return self.explained_fraction > max(2 * self.chance_fraction, 0.01)

    def sentence(self) -> str:
        """Return a sentence about the structure."""
        if not self.stands_out:
            return "Screening finds no structure above chance in the residual."
        return (
            f"The residual depends on {self.variable.replace('_', ' ')}, which explains"
            f" {100 * self.explained_fraction:.0f} % of the residual's variance on"
            f" runs held out, {self.detail}. This is a screening; it identifies no effect."
        )


def residuals(model: Model, campaign: Campaign, rate_hz: float = RATE_HZ) -> list[RunResidual]:
    """Return the residual of a fitted model in each run that is not excluded.

    Args:
        model: A fitted model.
        campaign: The runs.
        rate_hz: Rate the valid samples are thinned to, Hz.

    Raises:
        NotFittedError: A parameter has no value.
        MissingChannelError: A run lacks a channel of the model.
    """
    found = []
    for recording in campaign.evidence:
        there = [
            c
            for c in VARIABLES.values()
            if set(measured_channels([c], model.signals)) <= {*recording.columns}
        ]
        channels = zero_phase_channels(
            recording, [*model.channels, model.target, *there], model.low_pass, model.signals
        )
        step = max(1, int(recording.sample_rate_hz / rate_hz))
        places = settled(model, channels, step)
        estimated = estimate(model, channels)[places]
        run = channels.at(places)
        found.append(RunResidual(run, estimated, run[model.target] - estimated))
    return found


def centred(model: Model, values: Sequence[FloatArray]) -> list[FloatArray]:
    """Remove each run's mean, or the mean over all runs when run offsets are no nuisance.

    Args:
        model: The model whose samples count.
        values: One array per run, shape (n,) or (n, columns).
    """
    if model.run_offsets:
        return [part - part.mean(axis=0) for part in values]
    mean = np.concatenate(values).mean(axis=0)
    return [part - mean for part in values]


@dataclass(frozen=True)
class Profile:
    """A residual over one variable, for a figure.

    Attributes:
        label: Name and unit of the variable.
        x: The variable, all runs together, shape (n,); a motor angle within its turn.
        residual: The residual as it was screened, its means removed, shape (n,).
        unit: Unit of the residual.
    """

    label: str
    x: FloatArray
    residual: FloatArray
    unit: str


def profile(model: Model, parts: Sequence[RunResidual], variable: str) -> Profile:
    """Return the residual over one of the `VARIABLES`.

    Args:
        model: The model behind the residual.
        parts: From `residuals`.
        variable: Name of the variable.
    """
    channel = VARIABLES[variable]
    x = np.concatenate([p.estimate if channel == model.target else p.run[channel] for p in parts])
    if variable == "motor_angle":
        x = np.mod(x, 2 * np.pi)
    left = np.concatenate(centred(model, [part.values for part in parts]))
    source = "estimated load" if channel == model.target else channel.removesuffix("_s")
    words = variable.replace("_", " ") if variable == "motor_angle" else source
    return Profile(f"{words}, {unit_of(channel)}", x, left, model.unit)


def largest_structure(model: Model, campaign: Campaign, seed: int = 0) -> list[Structure]:
    """Rank what a model's residual goes with, largest first.

    Args:
        model: A fitted model.
        campaign: The runs; two at least.
        seed: Seed of the permutations.

    Returns:
        One structure per variable that varies in the runs, ranked by explained fraction.

    Raises:
        ResidualError: Fewer than two runs have samples.
    """
    runs = [part for part in residuals(model, campaign) if len(part.values) > 1]
    if len(runs) < 2:
        raise ResidualError(
            f"{len(runs)} runs are too few to screen a residual.",
            "A map is fitted on all other runs and scored on the one left out.",
        )
    left = centred(model, [part.values for part in runs])
    maps = [_Map.of(model, *parts) for parts in _features(model, runs)]
    shifted = _surrogates(left, seed, SURROGATES)
    chance = max((m.explained(r) for m in maps for r in shifted), default=0.0)
    found: dict[str, Structure] = {}
    for m in maps:
        structure = m.structure(left, max(chance, 0.0), unit_of(model.target))
        best = found.get(structure.variable)
        if best is None or structure.explained_fraction > best.explained_fraction:
            found[structure.variable] = structure  # of all orders of a ripple the best one
    return _ranked(list(found.values()))


def _ranked(structures: list[Structure]) -> list[Structure]:
    """Sort by explained fraction; prefer the direction to a speed that is only slightly better."""

    def rank(structure: Structure) -> float:
        share = structure.explained_fraction
        return share / SIMPLER_SHARE if structure.variable == "velocity_sign" else share

    return sorted(structures, key=rank, reverse=True)


def _surrogates(left: list[FloatArray], seed: int, count: int) -> list[list[FloatArray]]:
    """Return residuals that keep each run's own rhythm but no longer go with its variables."""
    random = np.random.default_rng(seed)
    return [
        [
            random.choice([-1.0, 1.0]) * np.roll(r, random.integers(len(r) // 10, len(r)))
            for r in left
        ]
        for _ in range(count)
    ]


def _shown(value: float, unit: str, sign: str = "") -> str:
    """Return a value for people to read: torques of this rig are thousandths of N m."""
    return f"{1e3 * value:{sign}.3g} mN m" if unit == "N m" else f"{value:{sign}.3g} {unit}"


_Features = tuple[str, list[FloatArray], Sequence[str]]
"""Variable, its columns in each run, and the quantity of each column."""


def _features(model: Model, runs: list[RunResidual]) -> Iterable[_Features]:
    for variable, channel in VARIABLES.items():
        if any(channel not in part.run for part in runs):
            continue
        # a sensor's noise correlates with its own residual, so the estimate replaces the sensor
        values = [part.estimate if channel == model.target else part.run[channel] for part in runs]
        if variable == "motor_angle":
            yield from (_ripple(values, order) for order in range(1, ORDERS + 1))
        elif variable == "velocity_sign":
            edges = np.array([-REST_RAD_S, REST_RAD_S])
            labels = ["when opening", "at rest", "when closing"]
            yield variable, [_one_hot(v, edges) for v in values], labels
        else:
            low, high = np.percentile(np.concatenate(values), [1, 99])
            if high > low:
                edges = np.linspace(low, high, BINS + 1)[1:-1]
                centres = np.linspace(low, high, 2 * BINS + 1)[1::2]
                labels = [f"near {centre:.3g} {unit_of(channel)}" for centre in centres]
                yield variable, [_one_hot(v, edges) for v in values], labels


def _one_hot(values: FloatArray, edges: FloatArray) -> FloatArray:
    bins = np.digitize(values, edges)
    return np.equal(bins[:, None], np.arange(len(edges) + 1)).astype(np.float64)


def _ripple(angles: list[FloatArray], order: int) -> _Features:
    columns = [np.column_stack([np.sin(order * a), np.cos(order * a)]) for a in angles]
    times = "once" if order == 1 else f"{order} times"
    return "motor_angle", columns, [f"{times} a motor turn"]


@dataclass(frozen=True)
class _Map:
    """A linear map of one variable, laid out run by run so that leaving a run out is cheap."""

    variable: str
    columns: list[FloatArray]
    labels: Sequence[str]
    grams: FloatArray  # (runs, k, k)

    @classmethod
    def of(
        cls, model: Model, variable: str, columns: list[FloatArray], labels: Sequence[str]
    ) -> "_Map":
        """Lay out a map of columns, shape (n, k) a run, its means removed like the residual's."""
        inner = centred(model, columns)
        return cls(variable, inner, labels, np.array([part.T @ part for part in inner]))

    def _solve(self, gram: FloatArray, right: FloatArray) -> FloatArray:
        # the pull towards zero settles bins that the fitted runs never visit
        pull = 1e-3 * max(np.trace(gram) / len(gram), np.finfo(float).tiny)
        solution: FloatArray = np.linalg.solve(gram + pull * np.eye(len(gram)), right)
        return solution

    def explained(self, left: list[FloatArray]) -> float:
        """Return the share of variance explained on runs left out one at a time."""
        rights = np.array([c.T @ r for c, r in zip(self.columns, left, strict=True)])
        gram, right = self.grams.sum(axis=0), rights.sum(axis=0)
        gained = 0.0
        for own_gram, own_right in zip(self.grams, rights, strict=True):
            weights = self._solve(gram - own_gram, right - own_right)
            gained += float(2 * weights @ own_right - weights @ own_gram @ weights)
        return gained / max(sum(float(r @ r) for r in left), np.finfo(float).tiny)

    def structure(self, left: list[FloatArray], chance: float, unit: str) -> Structure:
        """Return the values of the function fitted on all runs."""
        rights = sum(c.T @ r for c, r in zip(self.columns, left, strict=True))
        weights = self._solve(self.grams.sum(axis=0), np.asarray(rights))
        if len(self.labels) == 1:  # a ripple: sine and cosine
            amplitude = float(np.hypot(*weights))
            detail = f"{_shown(amplitude, unit)} {self.labels[0]}"
        else:
            low, high = np.percentile(np.concatenate([c @ weights for c in self.columns]), [5, 95])
            amplitude = float(high - low) / 2
            largest = int(np.argmax(np.abs(weights)))
            detail = f"largest ({_shown(weights[largest], unit, '+')}) {self.labels[largest]}"
        return Structure(self.variable, self.explained(left), chance, amplitude, unit, detail)
