"""The common interface of all estimators of a channel: fit, predict, step, save, load.

An estimator is an immutable object. A recipe fits one: `ModelRecipe`, `BankRecipe`,
`NetworkRecipe` and `ResidualRecipe` contain settings and fit an estimator on a campaign.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from estimation.campaign import Campaign
from estimation.live_channels import CausalChannels
from estimation.recording import FloatArray, Recording


class Stepper:
    """An estimator as it runs live, on the channels of a source, which holds the filters' state.

    Attributes:
        inside: Which of the last samples lay in the range fitted on, shape (n,); None where an
            estimator has no range.
        half_width: Half the 95 % interval of the newest sample; None where it is not known.
    """

    inside: NDArray[np.bool_] | None = None
    half_width: float | None = None

    def __init__(self, source: CausalChannels) -> None:
        self._source = source

    @property
    def channels(self) -> tuple[str, ...]:
        """Measured channels that `step` needs."""
        return self._source.measured

    def step(self, time_s: ArrayLike, measured: Mapping[str, ArrayLike]) -> FloatArray:
        """Take the next samples, one or many, and return their estimates, shape (n,)."""
        raise NotImplementedError


def rows_of(channels: Mapping[str, FloatArray] | Recording, names: Sequence[str]) -> FloatArray:
    """Return the named channels of each sample, shape (n, names)."""
    return np.column_stack([channels[name] for name in names])


class Estimator(Protocol):
    """An estimator of one channel of the rig."""

    @property
    def target(self) -> str:
        """Channel that is estimated; its name ends in the unit."""
        ...

    def predict(self, recording: Recording, causal: bool = False) -> FloatArray:
        """Return the estimate for each sample of a recording, shape (n,).

        With `causal`, filters run as live, and the result is that of the stepper to rounding.
        """
        ...

    def stepper(self, sample_rate_hz: float) -> Stepper:
        """Return the estimator as it runs live, before its first sample."""
        ...

    def save(self, path: Path) -> None:
        """Write the estimator to a file that `load` reads."""
        ...


class Recipe(Protocol):
    """The settings of a fit of an estimator on a campaign."""

    def fit(self, campaign: Campaign) -> Estimator:
        """Fit on the runs that are not excluded."""
        ...


def load(path: Path) -> Estimator:
    """Read an estimator: a model file (`.toml`), a state estimator or a network (`.npz`).

    Raises:
        ModelFileError: A model file cannot be read.
        NetworkError: An NPZ file cannot be read.
    """
    from estimation.estimators.bank import BankEstimator
    from estimation.estimators.model import ModelEstimator
    from estimation.estimators.network import NetworkEstimator
    from estimation.estimators.residual import ResidualEstimator
    from estimation.model_file import read
    from estimation.networks.network import read_arrays, schema_of

    if path.suffix == ".toml":
        return ModelEstimator(read(path))
    if schema_of(path).startswith(BankEstimator.SCHEMA.rpartition("/")[0]):
        return BankEstimator.load(path)
    arrays = read_arrays(path, NetworkEstimator.SCHEMA)
    if "model" in arrays:
        return ResidualEstimator.from_arrays(arrays)
    return NetworkEstimator.from_arrays(arrays)
