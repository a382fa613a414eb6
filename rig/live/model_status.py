"""Status of the models in the display: their age, and the range of their fit."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np

from estimation.channels import unit_of
from estimation.model import Model
from rig.live import text as words
from rig.live.block import DeviceStatus, FloatArray, SampleBlock
from rig.live.estimator import ModelEstimator
from rig.live.state import Value
from rig.output.table import counted

NAME = "estimate"
STALE_DAYS = 180.0
"""The days a calibration is good for unless stated; a fit is one."""


class ModelStatus:
    """Holds models against today and what they estimate against what they were fitted on.

    Args:
        models: Fitted models.
        now: Time of the session.
    """

    def __init__(self, models: Sequence[Model], now: datetime | None = None) -> None:
        self._ranges = {
            model.target: (*model.evidence.target_range, 2 * model.evidence.rmse_with_means)
            for model in models
            if model.evidence is not None and model.evidence.target_range is not None
        }
        made = [model.evidence.made_at for model in models if model.evidence is not None]
        days = [_days(text, now or datetime.now(UTC)) for text in made if text]
        self._days = max(days) if days else None

    def of(self, estimates: Mapping[str, FloatArray], outside: Sequence[str] = ()) -> DeviceStatus:
        """Return the status with new estimates: `suspect` beyond a range, `stale` when too old.

        Beyond is by more than the estimate's own interval.

        Args:
            estimates: Estimates of the newest samples by channel.
            outside: Channels whose estimates lie outside the fitted range, by their estimator.
        """
        if outside:
            names = ", ".join(words.name_of(name) for name in outside)
            return DeviceStatus(NAME, "suspect", f"{names} outside what it was fitted on")
        outside = [
            _beyond(name, low, high)
            for name, (low, high, margin) in self._ranges.items()
            if name in estimates and _leaves(estimates[name], low - margin, high + margin)
        ]
        if outside:
            return DeviceStatus(NAME, "suspect", ", ".join(outside))
        if self._days is None:
            return DeviceStatus(NAME, "ok", "within its fit, which has no date")
        state = "stale" if self._days > STALE_DAYS else "ok"
        return DeviceStatus(NAME, state, f"fitted {counted(round(self._days), 'day')} ago")


def with_model_status(
    blocks: Iterator[SampleBlock], estimators: Sequence[ModelEstimator]
) -> Iterator[SampleBlock]:
    """Yield blocks as they come, each with the status of its estimators.

    Args:
        blocks: The stream. It is closed when this one is.
        estimators: The estimators of its estimates.
    """
    status = ModelStatus([e.model for e in estimators if e.model is not None])
    try:
        for block in blocks:
            outside = [e.target_channel for e in estimators if e.outside]
            told = status.of(block.estimates, outside)
            inside = {e.target_channel: e.inside for e in estimators if e.inside is not None}
            yield replace(block, devices=(*block.devices, told), inside=inside if block else {})
    finally:
        close = getattr(blocks, "close", None)
        if close is not None:
            close()


def _beyond(channel: str, low: float, high: float) -> str:
    """Return a message for an estimate outside the range of its fit."""
    unit = unit_of(channel)
    ends = words.digits(Value(low), unit), words.with_unit(Value(high), unit)
    return f"{words.name_of(channel)} beyond its fit, {ends[0]} to {ends[1]}"


def _leaves(values: FloatArray, low: float, high: float) -> bool:
    """Whether the mean of a block is beyond a range."""
    known = values[np.isfinite(values)]
    return known.size > 0 and not low <= float(known.mean()) <= high


def _days(made_at: str, now: datetime) -> float:
    return (now - datetime.fromisoformat(made_at)) / timedelta(days=1)
