"""Blocks of a stream with one more line: whether the model still fits what is measured."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from estimation.errors import EstimationError
from estimation.model import Model
from estimation.recording import Recording
from estimation.watch import ResidualWatch, Sight
from rig.live.block import DeviceStatus, SampleBlock
from rig.live.estimator import ModelEstimator
from rig.live.model_status import with_model_status

PIECE_S = 5.0
"""A stream has no runs; its pieces of this length stand for them."""

PIECE_SPREAD = 0.25
"""Pieces of one run differ more than runs do."""


def with_status(
    blocks: Iterator[SampleBlock], estimators: Sequence[ModelEstimator]
) -> Iterator[SampleBlock]:
    """Yield blocks as they come, with the state of the models that estimate on them.

    A single declared model is also watched by the error of its equation.
    """
    models = [estimator.model for estimator in estimators if estimator.model is not None]
    if estimators:
        blocks = with_model_status(blocks, estimators)
    return watched(blocks, models[0]) if len(models) == 1 else blocks


def watched(blocks: Iterator[SampleBlock], model: Model) -> Iterator[SampleBlock]:
    """Yield blocks as they come, each with the result of the residual monitor.

    Args:
        blocks: The stream. It is closed when this one is.
        model: A fitted model.
    """
    watch = ResidualWatch(model, PIECE_SPREAD)
    held: list[SampleBlock] = []
    status = DeviceStatus("model", "watching", f"{model.name}: no {PIECE_S:g} s yet")
    try:
        for block in blocks:
            if held and len(block) and block.time_s[0] <= held[-1].time_s[-1]:
                held = []  # the device's clock restarted
            if len(block):
                held.append(block)
            if held and held[-1].time_s[-1] - held[0].time_s[0] >= PIECE_S:
                status = _status(model, watch, held) or status
                held = []
            yield replace(block, devices=(*block.devices, status))
    finally:
        close = getattr(blocks, "close", None)
        if close is not None:
            close()


def _status(model: Model, watch: ResidualWatch, held: list[SampleBlock]) -> DeviceStatus | None:
    names = [n for n in held[0].columns if all(n in block.columns for block in held)]
    piece = Recording(
        f"{held[0].time_s[0]:.0f} s",
        np.concatenate([block.time_s for block in held]),
        {name: np.concatenate([block.columns[name] for block in held]) for name in names},
        flags=np.concatenate([block.flags for block in held]),
    )
    try:
        sight = watch.see(piece)
    except EstimationError as error:
        return DeviceStatus("model", "not watched", str(error))
    return None if sight is None else DeviceStatus("model", _state(sight), told(model, sight))


def _state(sight: Sight) -> str:
    return "fits" if sight.fits else "no longer fits"


def told(model: Model, sight: Sight) -> str:
    """Return the text of a result of the monitor."""
    if sight.usual is None:
        return f"{model.name}: learning its usual error"
    ratio = f"error {sight.rmse / sight.usual:.2f} times that of its fit"
    return f"{model.name}: {ratio}" + ("" if sight.fits else f"; since {sight.since}")
