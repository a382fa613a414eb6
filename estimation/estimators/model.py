"""Linear and physical estimators: an equation of effects."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from estimation.campaign import Campaign
from estimation.estimator import Stepper, rows_of
from estimation.fitting import fit
from estimation.live_channels import CausalChannels
from estimation.model import Model, predict
from estimation.model_file import write
from estimation.recording import FloatArray, Recording


class Stream(Stepper):
    """A model's causal estimator. It holds the state of the filters and of the effects.

    The result is that of `predict(model, recording, causal=True)` to rounding, however the samples
    are cut into batches.
    """

    def __init__(self, model: Model, sample_rate_hz: float) -> None:
        """Start a fitted model before the first sample, at a nominal rate of the device's clock.

        Raises:
            NotFittedError: A parameter has no value.
            FilterError: The model's filter does not fit the rate.
        """
        channels, low_pass = model.channels, model.low_pass
        super().__init__(CausalChannels(channels, sample_rate_hz, low_pass, signals=model.signals))
        self.model = model
        self._weights = [np.array(term.weights) for term in model.terms]
        self._shapes = [term.numbers(term.effect.shape) for term in model.terms]
        self._waves = [bool(term.turning) for term in model.terms]
        self._states = [term.effect.start() for term in model.terms]
        self._rest = rest_speeds(model)
        self.half_width = usual_half_width(model)

    def step(self, time_s: ArrayLike, measured: Mapping[str, ArrayLike]) -> FloatArray:
        """Take the next samples and return their estimates, shape (n,), in `model.unit`.

        Device times increase across batches; measured channels are in SI units, others are ignored.
        The estimate is NaN where a needed channel is not finite.
        """
        channels = self._source.step(time_s, measured)
        if np.size(time_s):  # an empty batch changes nothing
            stands = any(bool(abs(channels[k][-1]) < v) for k, v in self._rest.items())
            # the interval is of errors in motion: at rest friction takes any value
            self.half_width = None if stands else usual_half_width(self.model)
        rows = rows_of(channels, self.model.channels)
        return np.array([self._one(row) for row in rows.tolist()])

    def _one(self, row: list[float]) -> float:
        sample = dict(zip(self.model.channels, row, strict=True))
        total = 0.0
        for term, weights, shape, is_wave, state in zip(
            self.model.terms, self._weights, self._shapes, self._waves, self._states, strict=True
        ):
            inputs = {role: sample[channel] for role, channel in term.channels.items()}
            values = term.effect.step(inputs, shape, state)
            if is_wave:
                gains = term.passed(sample, shape, self.model.low_pass)
                values = [v * gain for v, gain in zip(values, gains, strict=True)]
            total += sum(w * v for w, v in zip(weights, values, strict=True))
        return float(total)


def usual_half_width(model: Model) -> float | None:
    """Return half the 95 % interval of a model's live errors in motion; None where not known."""
    return model.evidence.half_width if model.evidence else None


def settles_s(model: Model) -> float:
    """Return the time from the first sample on in which a live estimate is not valid, s.

    A fit omits as much at either end of a run.
    """
    return 2.0 * model.low_pass.reach_s


def rest_speeds(model: Model) -> dict[str, float]:
    """Return the speeds below which a part that the model reads is at rest, where one is stated."""
    rest = model.signals.rest.items()
    return {speed: slowest for speed, slowest in rest if speed in model.channels and slowest > 0}


def fitted_range(model: Model) -> tuple[float, float] | None:
    """Return the target's range in the fit, wider by half the interval; None where not stated."""
    known = model.evidence
    if known is None or known.target_range is None:
        return None
    margin = known.half_width or 0.0
    return known.target_range[0] - margin, known.target_range[1] + margin


@dataclass(frozen=True)
class ModelEstimator:
    """A fitted model as an estimator."""

    model: Model

    @property
    def target(self) -> str:
        """Channel that is estimated."""
        return self.model.target

    def predict(self, recording: Recording, causal: bool = False) -> FloatArray:
        """Return the estimate for each sample; see `estimation.model.predict`."""
        return predict(self.model, recording, causal)

    def stepper(self, sample_rate_hz: float) -> Stream:
        """Return the model as it runs live."""
        return Stream(self.model, sample_rate_hz)

    def save(self, path: Path) -> None:
        """Write the model file."""
        write(self.model, path)


@dataclass(frozen=True)
class ModelRecipe:
    """Fits a declared model; the paper's straight line is the shipped model `linear`."""

    declared: Model

    def fit(self, campaign: Campaign) -> ModelEstimator:
        """Fit on the runs that are not excluded; see `estimation.fitting.fit` for the errors."""
        return ModelEstimator(fit(self.declared, campaign, bootstrap=0))
