"""What the display says of the models that estimate: their age, and the range of their fit."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np

from estimation.model import Model
from rig.live.block import DeviceStatus, FloatArray, SampleBlock

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
            model.target: model.evidence.target_range
            for model in models
            if model.evidence is not None and model.evidence.target_range is not None
        }
        made = [model.evidence.made_at for model in models if model.evidence is not None]
        days = [_days(text, now or datetime.now(UTC)) for text in made if text]
        self._days = max(days) if days else None

    def of(self, estimates: Mapping[str, FloatArray]) -> DeviceStatus:
        """Return the status with new estimates: `suspect` beyond a range, `stale` when too old."""
        outside = [
            f"{name} beyond {low:.3g} to {high:.3g}"
            for name, (low, high) in self._ranges.items()
            if name in estimates and _leaves(estimates[name], low, high)
        ]
        if outside:
            return DeviceStatus(NAME, "suspect", "outside what was fitted: " + ", ".join(outside))
        if self._days is None:
            return DeviceStatus(NAME, "ok", "its fit has no date")
        state = "stale" if self._days > STALE_DAYS else "ok"
        return DeviceStatus(NAME, state, f"fitted {self._days:.0f} days ago")


def with_model_status(
    blocks: Iterator[SampleBlock], models: Sequence[Model]
) -> Iterator[SampleBlock]:
    """Yield blocks as they come, each with what can be said of the models that estimate.

    Args:
        blocks: The stream. It is closed when this one is.
        models: Fitted models.
    """
    status = ModelStatus(models)
    try:
        for block in blocks:
            yield replace(block, devices=(*block.devices, status.of(block.estimates)))
    finally:
        close = getattr(blocks, "close", None)
        if close is not None:
            close()


def _leaves(values: FloatArray, low: float, high: float) -> bool:
    """Say whether the mean of a block is beyond a range by more than a tenth of it."""
    known = values[np.isfinite(values)]
    margin = 0.1 * (high - low)
    return known.size > 0 and not low - margin <= float(known.mean()) <= high + margin


def _days(made_at: str, now: datetime) -> float:
    return (now - datetime.fromisoformat(made_at)) / timedelta(days=1)
