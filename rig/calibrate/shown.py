"""What a guided calibration shows a person: each step's reading, and the result in words."""

import re
from collections.abc import Sequence

import numpy as np

from calibration.linear import CalibrationSet
from calibration.procedure import Measurement, Procedure, Result, Step
from calibration.record import CalibrationRecord
from estimation.channels import UnknownUnitError, unit_of

SHOWN = ("proximal_torque_n_m", "distal_torque_n_m", "motor_current_a", "fsr_v", "force_z_n")
"""Channels of a reading, those that a step has."""

PREFIXES = ((1.0, ""), (1e-3, "m"), (1e-6, "u"))


def reading(procedure: Procedure, measured: Sequence[Measurement], lines: CalibrationSet) -> str:
    """Return the reading of the last step: the procedure's own text, else mean and spread."""
    own = getattr(procedure, "reading", None)
    if own is not None:
        return str(own(measured, lines))
    recording = measured[-1].recording
    parts = [
        f"{name} {with_unit(float(np.mean(values)), unit_of(name))}"
        f" +- {with_unit(float(np.std(values)), unit_of(name))}"
        for name, values in recording.columns.items()
        if name in SHOWN
    ]
    return ", ".join([f"{len(recording)} samples", *parts])


SET_UP_S = 30.0
"""Time allowed for what a person does before a step."""


def announced(procedure: Procedure) -> list[str]:
    """Return the needs of a session, its duration and its moving parts, a line each."""
    steps = procedure.steps()
    own = [step.instruction for step in steps if step.instruction]
    moved = [step.target_angle_rad for step in steps]
    measured_s = sum(
        step.duration_s if angle is None else len(angle) / 1000.0
        for step, angle in zip(steps, moved, strict=True)
    )
    minutes = (measured_s + SET_UP_S * len(own)) / 60
    devices = " and ".join(name.replace("_", " ") for name in procedure.devices)
    lines = [
        f"Calibration of {procedure.kind}: {len(steps)} steps with the {devices},"
        f" {len(own)} of them set up by hand; about {max(1, round(minutes))} min.",
        _moving(steps),
    ]
    return lines + [f"  {text}" for text in dict.fromkeys(own)]


def _moving(steps: Sequence[Step]) -> str:
    """Return the sentence on motion and load of the steps."""
    angles = [s.target_angle_rad for s in steps if s.target_angle_rad is not None]
    loads = [s.load_command_a for s in steps if s.load_command_a is not None]
    if not angles and not loads:
        return "The rig does not move by itself."
    parts = []
    if angles:
        low, high = min(map(np.min, angles)), max(map(np.max, angles))
        parts.append(f"the spindle turns between {low:.2f} and {high:.2f} rad")
    if loads and (most := max(float(np.abs(load).max()) for load in loads)) > 0:
        parts.append(f"the load motor pulls with up to {most:.2f} A")
    return f"The rig moves by itself: {', '.join(parts)}. Keep hands off while it does."


def with_unit(value: float, unit: str) -> str:
    """Return a number with its unit, in thousandths or millionths where that reads better."""
    if unit == "kg":
        return f"{value * 1e3:.4g} g"
    if unit in ("", "1") or unit.startswith("counts"):
        return f"{value:.4g} {unit.removeprefix('1')}".strip()
    size = abs(value)
    factor, prefix = next((p for p in PREFIXES if size >= p[0]), PREFIXES[-1 if size else 0])
    return f"{value / factor:.4g} {prefix}{unit}"


def parameter_lines(result: Result | CalibrationRecord) -> list[str]:
    """Return a result's parameters with their units and standard deviations, a line each."""
    lines = [f"{name} {text}" for name, text in parameter_texts(result).items()]
    if result.fit.residual_rms is not None:
        rms = with_unit(result.fit.residual_rms, _unit(result.channel))
        lines.append(f"residual {rms} rms")
    return lines


def parameter_texts(result: Result | CalibrationRecord) -> dict[str, str]:
    """Return the name of each parameter, and its value with unit and standard deviation."""
    deviations = [row[k] ** 0.5 for k, row in enumerate(result.fit.covariance)]
    texts = {}
    for k, (name, value) in enumerate(result.fit.parameters.items()):
        unit = parameter_unit(name, result)
        spread = f" +- {with_unit(deviations[k], unit)}" if deviations else ""
        texts[name] = f"{with_unit(value, unit)}{spread}"
    return texts


MAIN = ("slope", "torque_constant_n_m_a", "gain_a", "stiffness_n_m_rad", "ratio", "mass_kg", "c1")
"""Gain or scale of each form of a fit."""


def main_parameter(record: CalibrationRecord) -> str:
    """Return the name and text of a record's gain or scale; empty if it has no parameter."""
    texts = parameter_texts(record)
    name = next((name for name in MAIN if name in texts), next(iter(texts), ""))
    return f"{name} {texts[name]}" if texts else ""


def parameter_unit(name: str, result: Result | CalibrationRecord) -> str:
    """Return the unit of a parameter: of a line's slope and zero from what it reads and gives."""
    if name == "slope":
        read = _unit(result.input) or "count"
        return f"{_unit(result.channel)} a {read}"
    if name == "zero":
        return _unit(result.input) or "counts"
    if power := re.fullmatch(r"c(\d+)", name):
        exponent, read = int(power[1]), _unit(result.input)
        below = f"/{read}^{exponent}" if exponent > 1 else f"/{read}"
        return _unit(result.channel) + (below if exponent and read else "")
    return _unit(name)


def _unit(name: str) -> str:
    if name == "contact_wrench":  # its residual is that of the forces
        return "N"
    if name.startswith("counts_per_"):
        return f"counts/{_unit(name.removeprefix('counts_'))}"
    try:
        return unit_of(name)
    except UnknownUnitError:
        return ""


def found_line(name: str, value: float | str) -> str:
    """Return another number of a session, or words on what was not measured, as a line."""
    if isinstance(value, str):
        return f"{name.removesuffix('_ratio')}: {value}"
    if name.endswith("_ratio"):
        return f"{name.removesuffix('_ratio')} {100 * value:.3g} %"
    return f"{name} {with_unit(value, _unit(name))}"
