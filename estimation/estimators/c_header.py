"""An estimator as one C header: from raw samples to the estimate, no heap, no library but libm.

Filters and differences are in double: two backward differences at 1 kHz would turn the rounding of
a float angle into more than the acceleration. All else, weights, products and nodes, is float32.
The result is that of `predict(recording, causal=True)` for gap-free samples.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from estimation.bank import states
from estimation.bank.beyond import STANDING_RAD_S, Beyond
from estimation.derived import (
    AGO,
    FALL,
    RISE,
    TRAVEL,
    TRAVEL_WINDOW_S,
    TURNED,
    TURNING,
    measured_channels,
    origin_of,
)
from estimation.errors import EstimationError
from estimation.estimators.bank import BankEstimator
from estimation.estimators.c_model import model_text
from estimation.estimators.c_templates import BANK, DIFFERENCES, HEADER, NETWORK, TRACKER
from estimation.estimators.model import ModelEstimator
from estimation.estimators.network import NetworkEstimator
from estimation.filters import PAPER
from estimation.kalman import tracker
from estimation.recording import FloatArray
from estimation.signals import Signals, reference
from estimation.window import ALIKE

TURNING_TRAVEL, TURNING_TURNED = (
    TURNING.replace("_angle_rad", suffix) for suffix in (TRAVEL, TURNED)
)


class ExportError(EstimationError):
    """An estimator cannot be written as C."""


Exported = BankEstimator | NetworkEstimator | ModelEstimator


@dataclass(frozen=True)
class _Row:
    """The channels of a row and what they are computed from.

    Attributes:
        measured: Measured channels, in order.
        windows: Channels that need the lowest value of a window.
        pasts: Channels whose last values are kept.
        sample_rate_hz: Rate of the calls.
        signals: The machine's derived channels.
    """

    measured: Sequence[str]
    windows: Sequence[str]
    pasts: Sequence[str]
    sample_rate_hz: float
    signals: Signals


def header(estimator: Exported, name: str, sample_rate_hz: float) -> str:
    """Return the header's text.

    Args:
        estimator: What is written.
        name: Prefix of everything in the header; a C identifier.
        sample_rate_hz: Rate at which the step is called.

    Raises:
        ExportError: The name is not a C identifier, or a channel cannot be computed in C.
        FilterError: The filter does not fit the rate.
    """
    if re.fullmatch(r"[a-z_][a-z0-9_]*", name) is None:
        raise ExportError(
            f"{name!r} cannot name things in C.", fix="Use small letters, digits and underscores."
        )
    motion, low_pass, signals = DIFFERENCES, PAPER, reference()
    channels: Sequence[str]
    if isinstance(estimator, BankEstimator):
        channels, model = estimator.bank.channels, _bank(estimator)
        motion, low_pass = _tracker(sample_rate_hz), estimator.low_pass
    elif isinstance(estimator, NetworkEstimator):
        channels, model = estimator.network.inputs, _network(estimator)
        low_pass = estimator.low_pass
    else:
        channels = [c for c in estimator.model.channels if c != "time_s"]
        model = model_text(estimator.model, channels.index)
        low_pass, signals = estimator.model.low_pass, estimator.model.signals
    measured = measured_channels(channels, signals)
    sections = low_pass.sections(sample_rate_hz)
    windows = [c for c in channels if c.endswith(TRAVEL) or FALL in c]
    pasts = _pasts(channels)
    row = _Row(measured, windows, pasts, sample_rate_hz, signals)
    text = HEADER
    for mark, value in {
        "MOTION": motion,
        "TARGET": estimator.target,
        "MEASURED_LIST": ", ".join(measured),
        "RATE": f"{sample_rate_hz!r}",
        "MEASURED": str(len(measured)),
        "ROW": str(len(channels)),
        "SECTION_COUNT": str(len(sections)),
        "SECTIONS": _double_rows(np.delete(sections, 3, axis=1)),
        "WINDOWS": str(max(len(windows), 1)),
        "WINDOW": str(max(1, round(TRAVEL_WINDOW_S * sample_rate_hz))),
        "ALIKE": f"{ALIKE!r}",
        "PASTS": str(max(len(pasts), 1)),
        "KEEP": _keep(pasts, measured),
        "FILL": "\n".join(_channel(k, c, row) for k, c in enumerate(channels)),
        "MODEL": model,
    }.items():
        text = text.replace(f"@{mark}@", value)
    return text.replace("NAME", name.upper()).replace("name_", f"{name}_")


def _floats(values: FloatArray) -> str:
    return ", ".join(f"{float(v):.9g}f" if v % 1 else f"{float(v):.1f}f" for v in np.ravel(values))


def _double_rows(table: FloatArray) -> str:
    return ", ".join(f"{{ {', '.join(f'{float(v)!r}' for v in row)} }}" for row in table)


def _float_rows(table: FloatArray) -> str:
    return ", ".join(f"{{ {_floats(row)} }}" for row in table)


def _ints(values: Sequence[int] | np.ndarray) -> str:
    return ", ".join(str(int(v)) for v in values)


def _pasts(channels: Sequence[str]) -> list[str]:
    """Return the measured channels and accelerations whose last values are kept."""
    found = [m["name"] + m["unit"] for m in map(AGO.match, channels) if m is not None]
    found += [channel.replace(RISE, "_") for channel in channels if RISE in channel]
    return list(dict.fromkeys(found))


def _keep(pasts: Sequence[str], measured: Sequence[str]) -> str:
    return "\n".join(
        f"    name_keep(&s->past[{k}], s->tick, {_value(name, measured)});"
        for k, name in enumerate(pasts)
    )


def _value(channel: str, measured: Sequence[str]) -> str:
    """Return the expression of a measured channel, a speed or an acceleration."""
    source, times = origin_of(channel)
    if times and source in measured:
        return f"{('speed', 'acceleration')[times - 1]}[{measured.index(source)}]"
    if channel in measured:
        return f"value[{measured.index(channel)}]"
    raise ExportError(f"The channel {channel} cannot be computed in C.")


def _channel(k: int, channel: str, row: _Row) -> str:
    """Return the statement that computes one channel of a row."""
    measured, windows, pasts = row.measured, row.windows, row.pasts

    def place(name: str) -> int:
        return measured.index(name)

    def ago(name: str, ticks: str) -> str:
        return f"name_ago(&s->past[{pasts.index(name)}], s->tick, {ticks})"

    def turned() -> str:
        return f"name_age(&s->window[{windows.index(TURNING_TRAVEL)}], s->tick)"

    combination = row.signals.combination(channel)
    if combination is not None:
        parts = [
            f"{share.times!r} * value[{place(share.channel)}] / {share.over!r}"
            for share in combination.shares
        ]
        if (turn := combination.direction) is not None:
            parts.append(f"{turn.size!r} * tanh({_value(turn.speed, measured)} / {turn.width!r})")
        value = " + ".join(parts)
    elif channel in windows:
        rises = channel.endswith(TRAVEL)
        source = channel.replace(TRAVEL, "_angle_rad") if rises else channel.replace(FALL, "_")
        sign = "" if rises else "-"
        slot = windows.index(channel)
        value = f"name_travel(&s->window[{slot}], s->tick, {sign}value[{place(source)}])"
    elif channel == TURNING_TURNED and TURNING_TRAVEL in windows:
        value = f"{turned()} / {row.sample_rate_hz!r}"
    elif RISE in channel and TURNING_TRAVEL in windows:
        source = channel.replace(RISE, "_")
        value = f"value[{place(source)}] - {ago(source, turned())}"
    elif (past := AGO.match(channel)) is not None:
        ticks = round(1e-3 * int(past["ms"]) * row.sample_rate_hz)
        value = ago(past["name"] + past["unit"], str(ticks))
    else:
        value = _value(channel, measured)
    return f"    row[{k}] = (float)({value}); /* {channel} */"


def _tracker(sample_rate_hz: float) -> str:
    found = tracker(sample_rate_hz)
    text = TRACKER.replace("@PERIOD@", f"{found.period_s!r}")
    for k, gain in enumerate(found.gain):
        text = text.replace(f"@GAIN{k}@", f"{float(gain)!r}")
    return text


def _bank(estimator: BankEstimator) -> str:
    bank, interval = estimator.bank, estimator.interval
    parents, factors = bank.tables
    columns = interval.columns if interval is not None else np.zeros(1, np.int64)
    widths = interval.weights if interval is not None else np.zeros(1)
    unknown = Beyond(np.zeros(1), np.ones(1), np.zeros(2))
    table = interval.beyond if interval is not None else unknown
    text = BANK
    for mark, value in {
        "PRODUCTS": str(len(bank.products)),
        "ORDERS": str(bank.orders),
        "SIZE": str(bank.size),
        "PARENTS": _ints(parents),
        "FACTORS": _ints(factors),
        "WEIGHTS": _floats(estimator.weights),
        "LOWEST": _floats(estimator.ranges[0]),
        "HIGHEST": _floats(estimator.ranges[1]),
        "WIDTH_COUNT": str(len(columns)),
        "WIDTH_COLUMNS": _ints(columns),
        "WIDTH_WEIGHTS": _floats(widths),
        "LEAST": f"{interval.least:.9g}f" if interval is not None else "0.0f",
        "AXES": str(len(table.step)),
        "LOWEST_NODE": _floats(table.lowest) if interval is not None else "NAN",
        "NODE_STEP": _floats(table.step),
        "NODES": _ints(table.values.shape),
        "BEYOND": _floats(table.values),
        "STANDING": f"{STANDING_RAD_S}f",
        "POSE_PLACE": f", row[{states.JUDGED}]" if bank.pose else "",
        "CENTRE": f"{states.POSITION_CENTRE_RAD}f",
        "SCALE": f"{states.POSITION_SCALE_RAD}f",
        "LOAD": f"{states.LOAD_SCALES[bank.surrogate]}f",
        "ACCELERATION": f"{states.ACCELERATION_SCALE_RAD_S2}f",
        "SLOWEST": f"{states.SLOWEST_RAD_S}f",
        "LIGHTEST": f"{states.LIGHTEST}f",
        "GEAR": f"{states.GEAR_RATIO}f",
        "TURN": f"{states.GEAR_RATIO * states.RIPPLE_STEP:.9g}f",
        "WRIST_ORDERS": str(bank.wrist_orders),
        "WRIST_POWERS": str(states.WRIST_POWERS),
        "WRIST_TURN": f"{2 * np.pi / states.WRIST_PERIOD_RAD:.9g}f",
        "POSE": f"name_held(row, {states.JUDGED})" if bank.pose else "0.0f",
        "STATES": str(len(states.STATES)),
        "LAGS": str(len(states.LAGS)),
        "JUDGED": str(bank.judged),
        "SLID": f"{states.SLID_RAD}f",
        "LEAVING": f"{states.LEAVING_S}f",
        "LEAVES": f"{TRAVEL_WINDOW_S - states.LEAVING_S}f",
    }.items():
        text = text.replace(f"@{mark}@", value)
    return text


def _network(estimator: NetworkEstimator) -> str:
    network = estimator.network
    text = NETWORK
    for mark, value in {
        "NODES": str(len(network.hidden)),
        "LOWEST": _floats(network.input_range[0]),
        "HIGHEST": _floats(network.input_range[1]),
        "HIDDEN": _float_rows(network.hidden),
        "OUTPUT": _floats(network.output[0]),
        "LOW": _floats(network.output_range[0, :1]),
        "HIGH": _floats(network.output_range[1, :1]),
    }.items():
        text = text.replace(f"@{mark}@", value)
    return text
