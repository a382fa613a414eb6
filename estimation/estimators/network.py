"""A network as an estimator: filtered and derived channels in, one channel out."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from estimation.campaign import Campaign
from estimation.closing import closing_samples, processed
from estimation.derived import zero_phase_channels
from estimation.estimator import Stepper, rows_of
from estimation.estimators.bank import EVERY
from estimation.estimators.instrument import instrument_of, only_one, require_own
from estimation.estimators.origin import Origin
from estimation.filters import PAPER, LowPass
from estimation.live_channels import CausalChannels, causal_channels
from estimation.networks import network as files
from estimation.networks.network import Network
from estimation.networks.training import Settings, train
from estimation.recording import FloatArray, Recording

STATE_INPUTS = (
    "spindle_angle_rad",
    "spindle_velocity_rad_s",
    "motor_acceleration_rad_s2",
    "motor_travel_rad",
)
"""Inputs of a network with physical states, in addition to the load."""


@dataclass(frozen=True)
class NetworkEstimator:
    """A trained network as an estimator."""

    SCHEMA: ClassVar[str] = "rig.estimator/1"

    network: Network  # the network; its inputs are channel names, its one output the target
    low_pass: LowPass = PAPER
    # instrument it was fitted on; empty where it is not known, or does not matter
    instrument: str = ""
    origin: Origin | None = None

    @property
    def target(self) -> str:
        """Channel that is estimated."""
        return self.network.outputs[0]

    @property
    def channels(self) -> tuple[str, ...]:
        """Channels that are read, measured or derived."""
        return self.network.inputs

    def predict(self, recording: Recording, causal: bool = False) -> FloatArray:
        """Return the estimate for each sample, shape (n,).

        Raises:
            InstrumentError: The recording is of another instrument.
            MissingChannelError: The recording lacks a channel.
            FilterError: The run cannot be filtered.
        """
        require_own(self.instrument, recording)
        source = causal_channels if causal else zero_phase_channels
        rows = rows_of(source(recording, self.channels, self.low_pass), self.channels)
        return self.network(rows)[:, 0]

    def for_any_instrument(self) -> "NetworkEstimator":
        """Return the estimator for use on instruments it was not fitted on."""
        return replace(self, instrument="")

    def stepper(self, sample_rate_hz: float) -> "NetworkStepper":
        """Return the network as it runs live."""
        return NetworkStepper(self, sample_rate_hz)

    def arrays(self) -> dict[str, np.ndarray]:
        """Return the estimator as named arrays; `from_arrays` gives it back."""
        processing = np.array([self.low_pass.cutoff_hz, float(self.low_pass.order)])
        own = {"low_pass": processing, "instrument": np.array(self.instrument)}
        origin = {} if self.origin is None else self.origin.arrays()
        return {**own, **origin, **files.to_arrays(self.network)}

    @classmethod
    def from_arrays(cls, arrays: dict[str, np.ndarray]) -> "NetworkEstimator":
        """Return the estimator of named arrays.

        Raises:
            NetworkError: An array is missing, or the shapes do not fit.
        """
        network = files.from_arrays(arrays)
        processing = arrays.get("low_pass", np.empty(0))
        if processing.shape != (2,):
            raise files.NetworkError("The network's file does not state its filter.")
        instrument = str(arrays.get("instrument", ""))
        try:
            origin = Origin.from_arrays(arrays)
        except ValueError as error:
            raise files.NetworkError("The network's file is damaged.", str(error)) from error
        low_pass = LowPass(float(processing[0]), int(processing[1]))
        return cls(network, low_pass, instrument, origin)

    def save(self, path: Path) -> None:
        """Write the estimator as NPZ."""
        files.write_arrays(path, self.SCHEMA, self.arrays())


class NetworkStepper(Stepper):
    """A network as it runs live; it has no interval."""

    def __init__(self, estimator: NetworkEstimator, sample_rate_hz: float) -> None:
        super().__init__(CausalChannels(estimator.channels, sample_rate_hz, estimator.low_pass))
        self.inside = np.empty(0, np.bool_)
        self._network = estimator.network

    def step(self, time_s: ArrayLike, measured: Mapping[str, ArrayLike]) -> FloatArray:
        """Take the next samples and return their estimates, shape (n,); NaN where one is lost."""
        rows = rows_of(self._source.step(time_s, measured), self._network.inputs)
        self.inside = self._network.inside(rows)
        return self._network(rows)[:, 0]


@dataclass(frozen=True)
class NetworkRecipe:
    """Trains a network on every n-th closing sample of a campaign, as the paper does.

    Its inputs are channels, measured or derived; every channel has the same filter.
    """

    inputs: tuple[str, ...]
    target: str
    settings: Settings = field(default_factory=Settings)
    low_pass: LowPass = PAPER
    every: int = EVERY

    def fit(self, campaign: Campaign) -> NetworkEstimator:
        """Train on the valid closing samples of the runs that are not excluded.

        Raises:
            NetworkError: torch is missing, or the samples cannot be learnt from.
            MissingChannelError: A run lacks a channel.
        """
        return self.fit_rest(campaign, lambda run: np.zeros(len(run)))

    def fit_rest(
        self, campaign: Campaign, known: Callable[[Recording], FloatArray]
    ) -> NetworkEstimator:
        """Train on the residual of another estimate of the target.

        `known` returns the other estimate for each sample of a recording, shape (n,).
        """
        rows, rest = [], []
        instruments = set()
        for recording in campaign.evidence:
            instruments.add(instrument_of(recording))
            run = processed(recording, [*self.inputs, self.target], self.low_pass)
            run = run.with_columns(**{self.target: run[self.target] - known(recording)})
            kept = closing_samples(run, keep_flagged=False)
            rows.append(rows_of(kept, self.inputs)[:: self.every])
            rest.append(kept[self.target][:: self.every, None])
        if not rows:
            raise files.NetworkError("No runs to train the network on.")
        names = (self.inputs, (self.target,))
        trained = train(np.concatenate(rows), np.concatenate(rest), names, self.settings)
        return NetworkEstimator(trained.network, self.low_pass, only_one(instruments))
