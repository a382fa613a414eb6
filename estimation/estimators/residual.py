"""A physical model and a small network on its residual."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from estimation.campaign import Campaign
from estimation.estimator import Stepper
from estimation.estimators.model import ModelRecipe, Stream
from estimation.estimators.network import NetworkEstimator, NetworkRecipe
from estimation.model import Model, predict
from estimation.model_file import parse, to_toml
from estimation.networks.network import NetworkError, write_arrays
from estimation.recording import FloatArray, Recording


@dataclass(frozen=True)
class ResidualEstimator:
    """The sum of a fitted model and of a network (`rest`) trained on its residual."""

    model: Model
    rest: NetworkEstimator

    def __post_init__(self) -> None:
        if self.model.target != self.rest.target:
            raise NetworkError(
                f"The model estimates {self.model.target}, the network {self.rest.target}."
            )

    @property
    def target(self) -> str:
        """Channel that is estimated."""
        return self.model.target

    def predict(self, recording: Recording, causal: bool = False) -> FloatArray:
        """Return the estimate for each sample, shape (n,).

        Raises:
            MissingChannelError: The recording lacks a channel.
        """
        return predict(self.model, recording, causal) + self.rest.predict(recording, causal)

    def stepper(self, sample_rate_hz: float) -> "ResidualStepper":
        """Return the estimator as it runs live."""
        return ResidualStepper(self, sample_rate_hz)

    def save(self, path: Path) -> None:
        """Write model and network as one NPZ."""
        arrays = {"model": np.array(to_toml(self.model)), **self.rest.arrays()}
        write_arrays(path, NetworkEstimator.SCHEMA, arrays)

    @classmethod
    def from_arrays(cls, arrays: dict[str, np.ndarray]) -> "ResidualEstimator":
        """Return the estimator of named arrays.

        Raises:
            ModelFileError: The model cannot be read.
            NetworkError: An array of the network is missing.
        """
        model = parse(str(arrays["model"]), "the estimator's model")
        return cls(model, NetworkEstimator.from_arrays(arrays))


class ResidualStepper(Stepper):
    """A model and a network as they run live; their sum has neither interval nor range."""

    def __init__(self, estimator: ResidualEstimator, sample_rate_hz: float) -> None:
        self._parts = (
            Stream(estimator.model, sample_rate_hz),
            estimator.rest.stepper(sample_rate_hz),
        )

    @property
    def channels(self) -> tuple[str, ...]:
        """Measured channels that `step` needs."""
        return tuple(sorted({name for part in self._parts for name in part.channels}))

    def step(self, time_s: ArrayLike, measured: Mapping[str, ArrayLike]) -> FloatArray:
        """Take the next samples and return their estimates, shape (n,); NaN where one is lost."""
        model, rest = (part.step(time_s, measured) for part in self._parts)
        return np.asarray(model + rest)


@dataclass(frozen=True)
class ResidualRecipe:
    """Fits a model, then a network on its residual; the network's target is the model's."""

    model: ModelRecipe
    network: NetworkRecipe

    def fit(self, campaign: Campaign) -> ResidualEstimator:
        """Fit both on the runs that are not excluded; see the two recipes for the errors."""
        fitted = self.model.fit(campaign).model
        rest = self.network.fit_rest(campaign, lambda recording: predict(fitted, recording))
        return ResidualEstimator(fitted, rest)
