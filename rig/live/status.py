"""Status lines of the display: age and range of calibrations and models, and whether models fit."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np

from calibration.rules import judge_range
from estimation.channels import unit_of
from estimation.errors import EstimationError
from estimation.estimators.model import fitted_range
from estimation.model import Model
from estimation.recording import FloatArray, Recording
from estimation.watch import ResidualWatch, Sight
from rig.configuration.config import Config
from rig.live import text as words
from rig.live.block import DeviceStatus, SampleBlock, Step, joined
from rig.live.estimator import LiveEstimator
from rig.live.joint_forces import with_joint_forces
from rig.live.state import Value
from rig.machines.reading import Reading
from rig.output.table import counted

STALE_DAYS = 180.0
"""The days a calibration is good for unless stated; a fit is one."""

PIECE_S = 5.0
"""A stream has no runs; its pieces of this length stand for them."""

PIECE_SPREAD = 0.25
"""Pieces of one run differ more than runs do."""


class CalibrationStatus:
    """Holds a session's active records against today and against what is measured.

    Without a store only the set in use is named.
    """

    def __init__(self, config: Config, set_name: str) -> None:
        self._set_name = set_name
        self._records = config.calibration_records
        self._remarks = [f"{v.channel} {v.message}" for v in config.calibration_verdicts()]

    def of(self, reading: Reading) -> DeviceStatus:
        """Return the status with a reading: `suspect` outside a range, `stale` past its days."""
        names = reading.counts.dtype.names or ()
        outside = [
            verdict.channel
            for record in self._records
            if record.input in names
            for verdict in judge_range(record, reading.counts[record.input])
        ]
        if outside:
            return DeviceStatus(
                "calibration", "suspect", f"outside its range: {', '.join(outside)}"
            )
        if self._remarks:
            return DeviceStatus("calibration", "stale", "; ".join(self._remarks))
        return DeviceStatus("calibration", "ok", f"{self._set_name}, {self._age()}")

    def _age(self) -> str:
        if not self._records:
            return "no records of this rig"
        oldest = min(self._records, key=lambda record: record.made)
        age = counted(round(_days(oldest.made, datetime.now(UTC))), "day")
        return f"{counted(len(self._records), 'record')}, oldest {age} ({oldest.channel})"


class ModelStatus:
    """Holds models against today and what they estimate against what they were fitted on."""

    def __init__(self, models: Sequence[Model], estimators: Sequence[LiveEstimator] = ()) -> None:
        self._estimators = estimators
        ranges = {model.target: fitted_range(model) for model in models}
        self._ranges = {target: known for target, known in ranges.items() if known is not None}
        made = [model.evidence.made_at for model in models if model.evidence is not None]
        days = [_days(datetime.fromisoformat(at), datetime.now(UTC)) for at in made if at]
        self._days = max(days, default=None)

    def step(self, block: SampleBlock) -> SampleBlock:
        """Return a block with the status, and with where its estimates are within their range."""
        outside = [e.target_channel for e in self._estimators if e.outside]
        inside = {e.target_channel: e.inside for e in self._estimators if e.inside is not None}
        devices = (*block.devices, self.of(block.estimates, outside))
        return replace(block, devices=devices, inside=inside if block else {})

    def of(self, estimates: Mapping[str, FloatArray], outside: Sequence[str] = ()) -> DeviceStatus:
        """Return the status with new estimates: `suspect` beyond a range, `stale` when too old.

        Beyond is by more than the estimate's own interval. `outside` are the channels whose
        estimators state that they are outside their fitted range.
        """
        beyond = [
            _beyond(name, low, high)
            for name, (low, high) in self._ranges.items()
            if name in estimates and not _within(estimates[name], low, high)
        ]
        if outside:
            names = ", ".join(words.name_of(name) for name in outside)
            beyond = [f"{names} outside what it was fitted on"]
        if beyond:
            return DeviceStatus("estimate", "suspect", ", ".join(beyond))
        if self._days is None:
            return DeviceStatus("estimate", "ok", "within its fit, which has no date")
        state = "stale" if self._days > STALE_DAYS else "ok"
        return DeviceStatus("estimate", state, f"fitted {counted(round(self._days), 'day')} ago")


class FitStatus:
    """Watches whether a fitted model still fits what is measured, by the error of its equation."""

    def __init__(self, model: Model) -> None:
        self._model = model
        self._watch = ResidualWatch(model, PIECE_SPREAD)
        self._held: list[SampleBlock] = []
        self._status = self._said("watching", f"no {PIECE_S:g} s yet")

    def step(self, block: SampleBlock) -> SampleBlock:
        """Return a block with the result so far."""
        held = self._held
        if held and len(block) and block.time_s[0] <= held[-1].time_s[-1]:
            held.clear()  # the device's clock restarted
        if len(block):
            held.append(block)
        if held and held[-1].time_s[-1] - held[0].time_s[0] >= PIECE_S:
            self._status = self._judged() or self._status
            held.clear()
        return replace(block, devices=(*block.devices, self._status))

    def _judged(self) -> DeviceStatus | None:
        piece = Recording(
            f"{self._held[0].time_s[0]:.0f} s",
            np.concatenate([block.time_s for block in self._held]),
            joined([block.columns for block in self._held]),
            flags=np.concatenate([block.flags for block in self._held]),
        )
        try:
            sight = self._watch.see(piece)
        except EstimationError as error:
            return DeviceStatus("model", "not watched", str(error))
        if sight is None:
            return None
        return self._said("fits" if sight.fits else "no longer fits", _error_words(sight))

    def _said(self, state: str, detail: str) -> DeviceStatus:
        return DeviceStatus("model", state, f"{self._model.name}: {detail}")


def model_steps(estimators: Sequence[LiveEstimator]) -> list[Step]:
    """Return the steps of blocks that estimators estimate on.

    They add the forces of a grasper's joints, the state of the models, and of a single declared
    model whether it still fits.
    """
    models = [estimator.model for estimator in estimators if estimator.model is not None]
    steps: list[Step] = [with_joint_forces]
    if estimators:
        steps.append(ModelStatus(models, estimators).step)
    return [*steps, FitStatus(models[0]).step] if len(models) == 1 else steps


def _error_words(sight: Sight) -> str:
    if sight.usual is None:
        return "learning its usual error"
    ratio = f"error {sight.rmse / sight.usual:.2f} times that of its fit"
    return ratio if sight.fits else f"{ratio}; since {sight.since}"


def _beyond(channel: str, low: float, high: float) -> str:
    """Return a message for an estimate outside the range of its fit and its interval."""
    unit, size = unit_of(channel), max(abs(low), abs(high))
    ends = words.digits(Value(low), unit, size), words.with_unit(Value(high), unit, size)
    return f"{words.name_of(channel)} beyond its fit, {ends[0]} to {ends[1]}"


def _within(values: FloatArray, low: float, high: float) -> bool:
    """Whether the mean of a block is within a range, or there is none."""
    known = values[np.isfinite(values)]
    return not known.size or low <= float(known.mean()) <= high


def _days(made: datetime, now: datetime) -> float:
    return (now - made) / timedelta(days=1)
