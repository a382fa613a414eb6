"""Torques and currents predicted from sensors that an equation does not read.

A candidate that reads a sensor of its own equation can explain that sensor's noise. Each effort
that an equation reads (a torque, a force, a current) is therefore replaced by its prediction
through the other declared equations: an instrumental variable. Angles are used as measured.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from estimation.causes.equations import ANGLES, Equation, Layout, RunSignals
from estimation.recording import FloatArray


def instrumented(channel: str, equation: str) -> str:
    """Return the name under which a channel's prediction for one equation is kept."""
    return f"{channel} for {equation}"


def add_instruments(layout: Layout) -> None:
    """Add to every run the efforts of every equation, predicted without that equation's sensors.

    Where no other sensor reaches an effort, a target is replaced by its own equation's estimate and
    a regressor is used as it was measured.
    """
    for equation in layout.equations.values():
        for run in layout.runs:
            _add(layout, equation, run)


def signal(run: RunSignals, channel: str, equation: str) -> str:
    """Return the channel that stands for another one in an equation: its prediction if any."""
    name = instrumented(channel, equation)
    return name if name in run.channels else channel


def _efforts(equation: Equation) -> list[str]:
    """Return the channels of an equation that are efforts: neither angles nor their derivatives."""
    names = [n for n in equation.channels if not _is_motion(n)]
    return names if equation.of_angle else [equation.target, *names]


def _is_motion(channel: str) -> bool:
    return (
        channel.endswith(
            (
                *ANGLES,
                "_velocity_rad_s",
                "_velocity_m_s",
                "_acceleration_rad_s2",
                "_acceleration_m_s2",
            )
        )
        or "_rate_" in channel
    )


def _add(layout: Layout, equation: Equation, run: RunSignals) -> None:
    own = set(_efforts(equation))
    torques = [e for e in layout.equations.values() if not e.of_angle]
    known = _propagated(torques, run, own)
    apart = _propagated([e for e in torques if e is not equation], run, own)
    for channel in own:
        if channel in known:
            run.channels[instrumented(channel, equation.name)] = known[channel]
            if channel in apart:  # else through the noise of this equation's own accelerations
                layout.independent.add((channel, equation.name))
        elif channel == equation.target:
            run.channels[instrumented(channel, equation.name)] = equation.estimate(run.channels)
    if equation.of_angle and equation.target in layout.measured:
        angle = equation.estimate(run.channels | {c: known[c] for c in own if c in known})
        # an estimate has no offset, and a place along the travel needs one
        angle = angle + float(np.mean(run.channels[equation.target] - angle))
        run.channels[instrumented(equation.target, equation.name)] = angle
        base = next((a for a in ANGLES if equation.target.endswith(a)), "")
        if base:
            unit = "_velocity_rad_s" if base == "_angle_rad" else "_velocity_m_s"
            speed = equation.target.removesuffix(base) + unit
            run.channels[instrumented(speed, equation.name)] = np.gradient(angle) * run.rate_hz


def _propagated(
    relations: Sequence[Equation], run: RunSignals, without: set[str]
) -> Mapping[str, FloatArray]:
    """Return every effort that can be worked out from sensors other than some."""
    efforts = {n for e in relations for n in _efforts(e)}
    known = {n: run.channels[n] for n in efforts if n not in without}
    for _ in relations:
        for relation in relations:
            missing = [n for n in _efforts(relation) if n not in known]
            if len(missing) != 1:
                continue
            (name,) = missing
            weight = 1.0 if name == relation.target else relation.channels[name]
            if weight == 0.0:
                continue
            zero = np.zeros_like(run.channels["time_s"])
            others = relation.estimate(run.channels | known | {name: zero})
            left = zero if name == relation.target else known[relation.target]
            known[name] = others if name == relation.target else (left - others) / weight
    return known
