"""A fitted model as the stream of estimates the display shows."""

from collections.abc import Mapping
from pathlib import Path

from estimation import model_file
from estimation.recording import MissingChannelError
from estimation.stream import Stream
from rig.live.block import FloatArray


class ModelEstimator:
    """Feeds blocks to a model's causal stream. Satisfies `rig.live.replay.EstimateStream`."""

    def __init__(self, path: Path, sample_rate_hz: float) -> None:
        """Read a model file and begin before the first sample.

        Args:
            path: Model file.
            sample_rate_hz: Nominal rate of the device's clock, Hz.

        Raises:
            EstimationError: The file is no model, the model is not fitted, or it cannot run at
                this rate.
        """
        model = model_file.read(path)
        self._stream = Stream(model, sample_rate_hz)
        self.target_channel = model.target
        self.model = model
        # two standard errors of the runs it was fitted on, their means left in: what a person at
        # the bench has to reckon with, in motion, on a rig that is as it was then
        self.half_width = 2 * model.evidence.rmse_with_means if model.evidence else None

    def push(self, columns: Mapping[str, FloatArray], time_s: FloatArray) -> FloatArray:
        """Return the estimate of the next samples, shape (n,).

        Raises:
            MissingChannelError: The stream lacks a channel that the model needs.
        """
        absent = [name for name in self._stream.channels if name not in columns]
        if absent:
            raise MissingChannelError(
                f"The model needs {', '.join(absent)}, and the stream has no such channel.",
                f"It has: {', '.join(columns) or 'none'}.",
                "Choose a model that needs less.",
            )
        return self._stream.step(time_s, columns)
