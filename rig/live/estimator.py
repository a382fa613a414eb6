"""A fitted estimator as the stream of estimates the display shows, and whether it suits a rig."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from estimation import model_file
from estimation.bank.edges import other_levels
from estimation.channels import ESTIMATED
from estimation.estimator import Estimator, Stepper, load
from estimation.estimators.bank import BankEstimator
from estimation.estimators.instrument import require_own
from estimation.estimators.model import ModelEstimator, settles_s, usual_half_width
from estimation.estimators.network import NetworkEstimator
from estimation.estimators.origin import Origin
from estimation.model import Evidence, Model
from estimation.recording import FloatArray, MissingChannelError, Recording
from estimation.signals import reference
from rig.configuration.config import Config
from rig.configuration.model_in_use import model_in_use
from rig.errors import UsageError
from rig.live.joint_forces import AXES, JOINTS, interval_of_joints
from rig.machines.shipped import of_equation

NOT_STATED: Mapping[str, float | str] = {}


class LiveEstimator:
    """Feeds blocks to an estimator's causal stream."""

    def __init__(
        self,
        estimator: Estimator,
        sample_rate_hz: float,
        conditions: Mapping[str, float | str] = NOT_STATED,
    ) -> None:
        """Begin before the first sample of a run of these conditions, at a nominal rate.

        Raises:
            EstimationError: The model is not fitted, or it cannot run at this rate.
        """
        self.model: Model | None = None  # only a physical model has effects to watch
        self.usual_half_width: float | None = None
        self.instrument = ""  # a physical model has none
        self.other_levels: Mapping[str, float] = {}  # conditions of the run that no run fitted had
        self._settles_s, self._began_s = 0.0, math.nan
        origin: Evidence | Origin | None = None
        if isinstance(estimator, ModelEstimator):
            self.model = estimator.model
            self.usual_half_width = usual_half_width(self.model)
            self._settles_s = settles_s(self.model)
            origin = self.model.evidence
        elif isinstance(estimator, BankEstimator | NetworkEstimator):
            self.instrument, origin = estimator.instrument, estimator.origin
        if isinstance(estimator, BankEstimator):
            self.other_levels = other_levels(estimator.only, conditions)
            estimator = estimator.at(conditions)
            interval = estimator.interval
            self.usual_half_width = interval.typical if interval is not None else None
        self.is_of_simulation = origin is not None and origin.is_simulated  # as far as stated
        self._constant = {n: float(x) for n, x in conditions.items() if not isinstance(x, str)}
        self.target_channel = estimator.target
        self.stream: Stepper = estimator.stepper(sample_rate_hz)

    @property
    def inside(self) -> NDArray[np.bool_] | None:
        """Which of the last samples lay in the fitted range, shape (n,); None without a range."""
        return self.stream.inside

    @property
    def outside(self) -> bool:
        """Whether most of the last samples lay outside that range."""
        inside = self.inside
        return inside is not None and inside.size > 0 and not inside.mean() > 0.5

    def push(self, columns: Mapping[str, FloatArray], time_s: FloatArray) -> FloatArray:
        """Return the estimate of the next samples, shape (n,); NaN until the filters have settled.

        A stream that begins in motion begins with a step in the derivatives. A condition of the run
        is a channel of one value.

        Raises:
            MissingChannelError: The stream lacks a channel that the model needs.
        """
        lacking = [name for name in self.stream.channels if name not in columns]
        stated = {n: np.full(len(time_s), x) for n, x in self._constant.items() if n in lacking}
        if absent := [name for name in lacking if name not in stated]:
            raise MissingChannelError(
                f"The model needs {', '.join(absent)}, and the stream has no such channel.",
                f"It has: {', '.join(columns) or 'none'}.",
                "Choose another with --model or `rig model use`; `rig model reset` undoes that.",
            )
        estimate = self.stream.step(time_s, {**columns, **stated})
        if math.isnan(self._began_s) and len(time_s):
            self._began_s = float(time_s[0])
        return np.where(time_s - self._began_s < self._settles_s, np.nan, estimate)


def within_range(estimator: LiveEstimator, estimate: FloatArray) -> FloatArray:
    """Return the estimate of the last samples, NaN outside the estimator's range, shape (n,)."""
    return estimate if estimator.inside is None else np.where(estimator.inside, estimate, np.nan)


def estimators_of(
    path: Path,
    sample_rate_hz: float,
    conditions: Mapping[str, float | str] = NOT_STATED,
    balance: str | None = None,
) -> list[LiveEstimator]:
    """Return the estimators of a file, each before its first sample.

    The file is a model file, of which one equation may be chosen, or a state estimator or a network
    (`.npz`).

    Raises:
        EstimationError: The file is not an estimator, else as `LiveEstimator`.
    """
    found: list[Estimator]
    if path.suffix == ".npz":
        found = [load(path)]
    else:
        found = [ModelEstimator(model) for model in models_in_use(path, balance)]
    return [LiveEstimator(one, sample_rate_hz, conditions) for one in found]


def with_estimates(recording: Recording, path: Path) -> Recording:
    """Return a recording with the live estimates of a file, `estimated_*`; NaN out of range.

    An EstimationError, too, where it is of another instrument or lacks a channel.
    """
    estimated = {}
    for estimator in estimators_of(path, recording.sample_rate_hz, recording.conditions):
        require_own(estimator.instrument, recording)
        name = f"{ESTIMATED}{estimator.target_channel}"
        values = estimator.push(recording.columns, recording.time_s)
        estimated[name] = within_range(estimator, values)
    return replace(recording, columns={**recording.columns, **estimated})


def models_in_use(path: Path, balance: str | None = None) -> list[Model]:
    """Return the models in use of a model file: those of a grasper's axes, else the first.

    Of a machine of one's own it is the first of each target. Of an equation, if one is given.
    Raises ModelFileError as `read_all`, and UsageError where there is no such equation.
    """
    models = of_equation(model_file.read_all(path), balance)
    of_axes = [model for model in models if model.target in AXES]
    if not of_axes and models[0].signals.rest != reference().rest:
        return list({model.target: model for model in reversed(models)}.values())[::-1]
    return of_axes or models[:1]


def passed_over(models: Sequence[Model | None], path: Path) -> list[str]:
    """Return a line where a file has other equations of a target than the models in use."""
    used = [model for model in models if model is not None]
    lines = []
    for model in used:
        others = [
            one.balance
            for one in model_file.read_all(path)
            if one.target == model.target and one.balance != model.balance
        ]
        if others:
            lines.append(
                f"Estimate of {model.target} by the equation {model.balance}; {path.name} has"
                f" {', '.join(others)} of it, too: --equation NAME chooses."
            )
    return lines


def without_interval(models: Iterable[Model | None], path: Path) -> list[str]:
    """Return a line where a file states no interval of its models' live estimates."""
    if all(model is None or usual_half_width(model) is not None for model in models):
        return []
    return [
        f"No interval: {path.name} does not state the error of its live estimate on runs that it"
        " was not fitted on. Write it again with `rig fit` or `rig diagnose` on more runs."
    ]


def half_widths(estimators: Sequence[LiveEstimator]) -> dict[str, float]:
    """Return half of the 95 % interval of each channel, SI, as of the newest sample."""
    found = {estimator.target_channel: estimator.stream.half_width for estimator in estimators}
    return interval_of_joints({k: width for k, width in found.items() if width is not None})


def shown_channels(estimators: Sequence[LiveEstimator], usual: tuple[str, ...]) -> tuple[str, ...]:
    """Return the signals to show: a grasper's joints, else the estimates, else the default."""
    targets = tuple(estimator.target_channel for estimator in estimators)
    return JOINTS if set(targets) & set(AXES) else targets or usual


def channels_of(estimators: Iterable[LiveEstimator]) -> set[str]:
    """Return the measured channels that estimators read."""
    return {name for one in estimators for name in one.stream.channels}


def require_channels(needed: Iterable[str], config: Config, path: Path) -> None:
    """Refuse a model that reads channels which the configured rig does not have.

    Of a rig without a logger board the channels are known only once its device is connected.

    Raises:
        UsageError: A channel is missing; names the choice that made the model the one in use.
    """
    if config.logger.driver != "teensy":
        return
    there = config.calibration_set().channels
    absent = sorted(set(needed) - set(there))
    if not absent:
        return
    fix = "Choose a model of this rig."
    if path == model_in_use(config.name):
        fix = (
            f"`rig model use` chose it for {config.name}; `rig model reset`, with the same --config"
            " or --sim, goes back to the configured model."
        )
    raise UsageError(
        f"The model {path.name} needs {', '.join(absent)}, which {config.name} does not measure.",
        f"It measures: {', '.join(there)}.",
        fix,
    )


def require_measured(estimators: Sequence[LiveEstimator], config: Config, path: Path) -> None:
    """Refuse a model that states it is of simulated recordings, for a real rig (UsageError)."""
    if config.is_simulated or not any(one.is_of_simulation for one in estimators):
        return
    raise UsageError(
        f"The model {path.name} was fitted on simulated recordings, and {config.name} is real.",
        "Its estimates would not be those of the rig.",
        "Fit one on recordings of the rig with `rig fit`, or add --from-simulation.",
    )
