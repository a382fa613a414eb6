"""An estimator as one C header: from raw samples to the estimate, no heap, no library but libm.

Filters and differences are in double: two backward differences at 1 kHz would turn the rounding of
a float angle into more than the acceleration. All else, weights, products and nodes, is float32.
The result is that of `predict(recording, causal=True)` for gap-free samples.
"""

import math
import re
from collections.abc import Callable, Sequence
from functools import cache

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined, Template

from estimation import derived
from estimation.bank import states
from estimation.bank.beyond import STANDING_RAD_S
from estimation.errors import EstimationError
from estimation.estimators.bank import BankEstimator
from estimation.estimators.c_model import model_text
from estimation.estimators.model import ModelEstimator, fitted_range, rest_speeds, settles_s
from estimation.estimators.network import NetworkEstimator
from estimation.kalman import tracker
from estimation.model import Model
from estimation.recording import FloatArray
from estimation.signals import Signals, reference

TURNING_TRAVEL = derived.TURNING.replace("_angle_rad", derived.TRAVEL)

USUAL_HZ = 1000.0
"""Rate of a header whose estimator's file contains none."""


ROUNDING = 1e-6
"""Samples by which a number of samples may be above a whole one by rounding."""


class ExportError(EstimationError):
    """An estimator cannot be written as C."""


Exported = BankEstimator | NetworkEstimator | ModelEstimator


def header(estimator: Exported, name: str, sample_rate_hz: float) -> str:
    """Return the text of a header whose step is called at a sample rate.

    Everything in it begins with `name`, a C identifier.

    Raises:
        ExportError: The name is not a C identifier, or a channel cannot be computed in C.
        FilterError: The filter does not fit the rate.
    """
    if re.fullmatch(r"[a-z_][a-z0-9_]*", name) is None:
        raise ExportError(
            f"{name!r} cannot name things in C.", fix="Use small letters, digits and underscores."
        )
    model, ranged, rests, signals = "", False, False, reference()
    settles, window = 0, derived.window_samples(sample_rate_hz)
    channels: Sequence[str]
    if isinstance(estimator, ModelEstimator):
        channels = [c for c in estimator.model.channels if c != "time_s"]
        model = model_text(estimator.model, channels.index)
        ranged = fitted_range(estimator.model) is not None
        rests = bool(rest_speeds(estimator.model))
        settles = math.ceil(settles_s(estimator.model) * sample_rate_hz - ROUNDING)
        low_pass, signals = estimator.model.low_pass, estimator.model.signals
    else:
        channels, low_pass = estimator.channels, estimator.low_pass
    program = _Program(channels, sample_rate_hz, signals)
    measured = program.measured
    integrated = [f"i == {k}" for k, c in enumerate(measured) if c in signals.integrals]
    text = _template().render(
        estimator=estimator,
        bank=estimator.bank if isinstance(estimator, BankEstimator) else None,
        network=estimator.network if isinstance(estimator, NetworkEstimator) else None,
        model=model,
        ranged=ranged,
        rests=rests,
        channels=channels,
        measured=measured,
        read=[signals.integrals.get(c, c) for c in measured],
        integrated=" || ".join(integrated),
        windows=program.windows,
        pasts=program.pasts,
        rate_hz=sample_rate_hz,
        settles=settles,
        window=window,
        wrapped=window * (1 + settles // window),
        sections=np.delete(low_pass.sections(sample_rate_hz), 3, axis=1),
        tracker=tracker(sample_rate_hz),
        keep="\n".join(program.keep(k, name) for k, name in enumerate(program.pasts)),
        fill="\n".join(program.fill(k, name) for k, name in enumerate(channels)),
    )
    return text.replace("NAME", name.upper()).replace("name_", f"{name}_")


def refused(model: Model) -> str:
    """Return the reason why a fitted model cannot be written as C; empty where it can."""
    rate_hz = (model.evidence and model.evidence.sample_rate_hz) or USUAL_HZ
    try:
        header(ModelEstimator(model), "model", rate_hz)
    except EstimationError as error:
        return error.what
    return ""


@cache
def _template() -> Template:
    """Return the C of an exported estimator; what stands in @{ }@ is filled in."""
    environment = Environment(
        loader=PackageLoader("estimation.estimators"),
        undefined=StrictUndefined,
        autoescape=False,  # noqa: S701  C, not HTML
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        variable_start_string="@{",
        variable_end_string="}@",
        block_start_string="@%",
        block_end_string="%@",
    )
    environment.globals |= {
        "states": states,
        "window_s": derived.TRAVEL_WINDOW_S,
        "standing_rad_s": STANDING_RAD_S,
        "alike": derived.ALIKE,
        "floats": _floats,
        "doubles": _doubles,
        "ints": _ints,
        "rows": _rows,
    }
    return environment.get_template("estimator.h.jinja")


def _floats(values: FloatArray) -> str:
    return ", ".join(f"{float(v):.9g}f" if v % 1 else f"{float(v):.1f}f" for v in np.ravel(values))


def _doubles(values: FloatArray) -> str:
    return ", ".join(f"{float(v)!r}" for v in values)


def _rows(table: FloatArray, written: Callable[[FloatArray], str]) -> str:
    return ", ".join(f"{{ {written(row)} }}" for row in table)


def _ints(values: Sequence[int] | np.ndarray) -> str:
    return ", ".join(str(int(v)) for v in values)


class _Program:
    """The statements that compute a row of channels from one sample.

    Of the channels in `windows` the lowest value of a window is needed, of the measured channels
    and accelerations in `pasts` the last values are kept.
    """

    def __init__(self, channels: Sequence[str], sample_rate_hz: float, signals: Signals) -> None:
        self._rate_hz, self._signals = sample_rate_hz, signals
        self.measured = derived.measured_channels(channels, signals)
        kinds = {channel: derived.now_of(channel) for channel in channels}
        self.windows = [c for c, (_, k) in kinds.items() if k in (derived.TRAVEL, derived.FALL)]
        pasts = [now for now, kind in kinds.values() if kind == derived.RISE or kind.isdigit()]
        self.pasts = list(dict.fromkeys(pasts))

    def keep(self, k: int, name: str) -> str:
        """Return the statement that keeps a value of the past at place k."""
        return f"    name_keep(&s->past[{k}], s->tick, {self._value(name)});"

    def fill(self, k: int, channel: str) -> str:
        """Return the statement that computes the channel at place k of a row."""
        now, kind = derived.now_of(channel)
        if channel in self.windows:
            sign = "-" if kind == derived.FALL else ""
            window = self.windows.index(channel)
            value = f"name_travel(&s->window[{window}], s->tick, {sign}{self._measured(now)})"
        elif kind == derived.TURNED and now == derived.TURNING and TURNING_TRAVEL in self.windows:
            value = f"{self._turned()} / {self._rate_hz!r}"
        elif kind == derived.RISE and TURNING_TRAVEL in self.windows:
            value = f"{self._measured(now)} - {self._ago(now, self._turned())}"
        elif kind.isdigit():
            value = self._ago(now, str(round(1e-3 * int(kind) * self._rate_hz)))
        else:
            value = self._value(channel)
        return f"    row[{k}] = (float)({value}); /* {channel} */"

    def _measured(self, channel: str) -> str:
        return f"value[{self.measured.index(channel)}]"

    def _ago(self, channel: str, ticks: str) -> str:
        return f"name_ago(&s->past[{self.pasts.index(channel)}], s->tick, {ticks})"

    def _turned(self) -> str:
        return f"name_age(&s->window[{self.windows.index(TURNING_TRAVEL)}], s->tick)"

    def _value(self, channel: str) -> str:
        """Return the expression of a channel: measured, a speed, an acceleration, a combination."""
        if (combination := self._signals.combination(channel)) is not None:
            parts = [
                f"{share.times!r} * {self._value(share.channel)} / {share.over!r}"
                for share in combination.shares
            ]
            if (turn := combination.direction) is not None:
                parts.append(f"{turn.size!r} * tanh({self._value(turn.speed)} / {turn.width!r})")
            return f"({' + '.join(parts)})"
        source, times = derived.origin_of(channel)
        if times and source in self.measured:
            return f"{('speed', 'acceleration')[times - 1]}[{self.measured.index(source)}]"
        if channel in self.measured:
            return self._measured(channel)
        raise ExportError(f"The channel {channel} cannot be computed in C.")
