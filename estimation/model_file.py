"""The model file: one readable TOML file, the same for a declared and for a fitted model.

schema = "rig.model/1"
name = "motor"
balance = "motor"
target = "proximal_torque_n_m"

[[effects]]
id = "friction.coulomb"
sign = -1
channels.speed = "motor_velocity_rad_s"
parameters.friction = { value = 0.012, unit = "N m", spread = 0.0003 }

A model of another machine than the reference rig states that machine's derived channels, its speeds
of standstill, its sensors, the positions that are integrals of a speed, its known loads and its
actuators under `[[signals.derived]]`, `[signals.rest]`, `[signals.sensors]`, `[signals.integrals]`
and `[signals]`.

A file of several equations contains each under `[[models]]`, with `[models.processing]`,
`[[models.effects]]`, `[models.signals]` and `[models.fit]`, and has the schema `rig.models/1`.
"""

import difflib
import tomllib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from datetime import datetime
from importlib.resources import files
from pathlib import Path
from typing import Any, cast, get_args

from estimation.channels import PLAIN_UNIT, is_same
from estimation.effects import effect
from estimation.errors import EstimationError, UnknownNameError, nearest
from estimation.file_kinds import UNKNOWN, kind_of
from estimation.files import not_utf8, write_text_atomic
from estimation.filters import LowPass
from estimation.model import Estimate, Evidence, Model, ModelError, Term
from estimation.plant_file import shipped_plant
from estimation.plant_models import declared
from estimation.signals import (
    Reading,
    Samples,
    Signals,
    combination_lines,
    read_combinations,
    reference,
)
from estimation.toml_table import Table, entries, value_text

SCHEMA = "rig.model/1"
SEVERAL = "rig.models/1"

OF_PARAMETER = ("value", "unit", "spread", "ci95")
"""Keys of a parameter."""

SAME_UNIT = {plain: unit for unit, plain in PLAIN_UNIT.items()} | {"1": "rad/m"}
"""Unit that a file may state for a parameter, to how it follows from the channels.

Files of earlier versions state an order along a position without a unit."""


class ModelFileError(ModelError):
    """A model file cannot be read; the message names the file and the key."""


class NoModelError(ModelFileError, UnknownNameError):
    """There is no model of that name, and no such file."""


def shipped() -> dict[str, Path]:
    """Return the files of declared models that come with the project, by name."""
    folder = Path(str(files("estimation"))) / "models"
    return {path.stem: path for path in sorted(folder.glob("*.toml"))}


def names() -> list[str]:
    """Return the names of all shipped models: files, and equations of the reference rig."""
    return sorted([*shipped(), *(model.balance for model in reference_rig())])


def reference_rig() -> list[Model]:
    """Return the equations of the reference rig, declared and not fitted."""
    return declared(shipped_plant("reference"))


def read(path: Path) -> Model:
    """Read a model file, of several equations the first one; see `read_all`."""
    return read_all(path)[0]


def read_all(path: Path) -> list[Model]:
    """Read every model of a model file, or of a name from `names`.

    Raises:
        NoModelError: No such file and no such name; it is a ModelFileError, too.
        ModelFileError: It is not TOML, or a key is unknown, missing or wrong.
    """
    known = shipped()
    place = known.get(str(path), path)
    own = [model for model in reference_rig() if model.balance == str(path)]
    if own:
        return own
    if not place.exists():
        near = difflib.get_close_matches(str(path), names(), n=1)
        raise NoModelError(
            f"There is no model {str(path)!r}: neither a file nor a shipped model.",
            f"Shipped: {', '.join(names())}.",
            f"Did you mean {near[0]!r}?" if near else "Name a model file, or one of these.",
        )
    try:
        text = place.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        kind = kind_of(error.object)
        if kind == UNKNOWN:
            raise ModelFileError(f"{path} is not a model file.", *not_utf8(error)) from error
        raise ModelFileError(
            f"{path} is {kind}, not a model file.",
            "A model file is TOML and holds a declared or fitted model.",
            "Fit one: rig fit LOGS --out FILE.toml.",
        ) from error
    except OSError as error:
        raise ModelFileError(
            f"The model file {path} cannot be read.", str(error), f"Shipped: {', '.join(names())}."
        ) from error
    return parse_all(text, str(place))


def parse(text: str, where: str = "model") -> Model:
    """Read a model from TOML text, of several equations the first one; see `parse_all`."""
    return parse_all(text, where)[0]


def parse_all(text: str, where: str = "model") -> list[Model]:
    """Read every model from TOML text; `where` names the file in messages.

    Raises:
        ModelFileError: The text is not TOML, or a key is unknown, missing or wrong.
    """
    try:
        top = Table(tomllib.loads(text), where, ModelFileError)
        schema = top.take("schema", str)
        if schema == SCHEMA:
            return [_model(top)]
        if schema != SEVERAL:
            raise ModelFileError(
                f"{where} is not a model of schema {SCHEMA} or {SEVERAL}.",
                f"It has the schema {schema}.",
                "Read it with the version of rig that wrote it, or fit the model again.",
            )
        models = [_model(entry) for entry in top.tables("models")]
        top.finish()
        if not models:
            raise ModelFileError(f"{where} holds no model.")
        twice = [name for name, n in Counter(m.balance for m in models).items() if n > 1]
        if twice:
            raise ModelFileError(
                f"{where} holds several models of the equation {twice[0]!r}.",
                "A diagnosis has one model of an equation.",
                "Give each its own name: balance = ...",
            )
    except tomllib.TOMLDecodeError as error:
        raise ModelFileError(f"{where} is not TOML.", str(error)) from error
    except ModelFileError:
        raise
    except EstimationError as error:
        raise ModelFileError(f"{where}: {error.what}", error.why, error.fix) from error
    return models


def _model(top: Table) -> Model:
    processing = top.table("processing")
    evidence = top.table("fit")
    target = top.take("target", str)
    samples = processing.choice("samples", ("", *get_args(Samples))) or None
    return top.made(
        Model,
        terms=tuple(_term(entry, target) for entry in top.tables("effects")),
        run_offsets=processing.take("run_offsets", bool, True),
        counted=cast(Samples | None, samples),
        low_pass=processing.made(LowPass),
        evidence=_evidence(evidence) if evidence.content else None,
        signals=_signals(top),
    )


def _signals(top: Table) -> Signals:
    """Return a model's own signals, or the reference rig's."""
    if "signals" not in top.content:
        return reference()
    table = top.table("signals")
    rest = table.table("rest")
    slowest = {speed: rest.number(speed) for speed in rest.content}
    sensors = table.table("sensors")
    readings = {channel: sensors.table(channel).made(Reading) for channel in sensors.content}
    derived, joined = (read_combinations(table.tables(key, [])) for key in ("derived", "joined"))
    integrals = table.table("integrals")
    speeds = {position: integrals.take(position, str) for position in integrals.content}
    loads, actuators = (tuple(map(str, table.take(k, list, []))) for k in ("loads", "actuators"))
    found = Signals(derived, slowest, readings, joined, speeds, loads, actuators)
    table.finish()
    return found


def write(model: Model, path: Path) -> None:
    """Write a model file; an existing one is replaced in one step."""
    write_text_atomic(path, to_toml(model))


def write_all(models: Sequence[Model], path: Path) -> None:
    """Write one or more models to a file; an existing one is replaced in one step."""
    write_text_atomic(path, to_toml(*models))


def to_toml(*models: Model) -> str:
    """Return one or more models as TOML text; `parse_all` gives the same models back."""
    if len(models) == 1:
        return "\n".join([f"schema = {value_text(SCHEMA)}", *_lines(models[0])]) + "\n"
    lines = [f"schema = {value_text(SEVERAL)}"]
    for model in models:
        lines += ["", "[[models]]", *_lines(model, "models.")]
    return "\n".join(lines) + "\n"


def _lines(model: Model, within: str = "") -> list[str]:
    lines = entries({key: getattr(model, key) for key in ("name", "balance", "target")})
    lines += entries({"description": model.description})
    lines += ["", f"[{within}processing]", *entries(asdict(model.low_pass))]
    lines += entries({"run_offsets": model.run_offsets, "samples": model.counted})
    if model.signals != reference():
        known = {key: list(getattr(model.signals, key)) for key in ("loads", "actuators")}
        lines += ["", f"[{within}signals]", *entries({k: v for k, v in known.items() if v})]
        lines += ["", f"[{within}signals.rest]", *entries(model.signals.rest)]
        lines += ["", f"[{within}signals.sensors]"] if model.signals.readings else []
        lines += entries({name: _known(one) for name, one in model.signals.readings.items()})
        lines += ["", f"[{within}signals.integrals]"] if model.signals.integrals else []
        lines += entries(model.signals.integrals)
        lines += combination_lines(model.signals.combinations, f"{within}signals.derived")
        lines += combination_lines(model.signals.joined, f"{within}signals.joined")
    for term in model.terms:
        lines += ["", f"[[{within}effects]]", *entries({"id": term.effect.id, "sign": term.sign})]
        lines += entries(term.channels, "channels.")
        for parameter in term.parameters:
            if (estimate := term.values.get(parameter.name)) is not None:
                stated = {"value": estimate.value, "unit": term.unit(parameter, model.target)}
                lines += entries({parameter.name: stated | _known(estimate)}, "parameters.")
    if model.evidence is not None:
        optional = ("made_at", "rig", "is_simulated")  # left out where nothing is known
        stated = {key: getattr(model.evidence, key) or None for key in optional}
        lines += ["", f"[{within}fit]", *entries(asdict(model.evidence) | stated)]
    return lines


def _known(stated: Reading | Estimate) -> dict[str, Any]:
    return {key: value for key, value in asdict(stated).items() if value is not None}


def _term(entry: Table, target: str) -> Term:
    kind = effect(entry.take("id", str))
    sign = entry.take("sign", int, 1)
    channels = entry.table("channels")
    parameters = entry.table("parameters")
    values, units = {}, {}
    for name in parameters.content:
        known = parameters.table(name)
        if unknown := [key for key in known.content if key not in OF_PARAMETER]:
            raise ModelFileError(
                f"{known.at(unknown[0])} has an unknown key {unknown[0]!r}.",
                f"Bounds and meaning are those of the effect: rig effects {kind.id}.",
                nearest(unknown[0], OF_PARAMETER),
            )
        units[name] = known.take("unit", str)
        values[name] = known.made(Estimate, ci95=_two(known, "ci95"))
    entry.finish()
    names = {role: channels.take(role, str) for role in channels.content}
    term = Term(kind, sign, names, values)
    _check_units(term, target, units)
    return term


def _check_units(term: Term, target: str, stated: Mapping[str, str]) -> None:
    """Raise when a parameter's stated unit is not the one its channels give it."""
    for parameter in term.parameters:
        unit = term.unit(parameter, target)
        written = stated.get(parameter.name, unit)
        if not any(is_same(one, unit) for one in (written, SAME_UNIT.get(written, written))):
            raise ModelError(
                f"{term.effect.id}: {parameter.name} is stated in {stated[parameter.name]!r},"
                f" not in {unit!r}.",
                "The unit follows from the target and the channels.",
                f'Convert the value to {unit}, and write unit = "{unit}".',
            )


def _two(table: Table, key: str) -> tuple[float, float] | None:
    if key not in table.content:
        return None
    values = table.take(key, list)
    if len(values) != 2 or not all(isinstance(v, int | float) for v in values):
        raise ModelFileError(f"{table.where}: {key} = {values!r} is not two numbers.")
    return float(values[0]), float(values[1])


def _evidence(table: Table) -> Evidence:
    runs = tuple(str(name) for name in table.take("runs", list))
    target_range, made_at = _two(table, "target_range"), _date(table)
    return table.made(Evidence, runs=runs, target_range=target_range, made_at=made_at)


def _date(table: Table) -> str:
    text: str = table.take("made_at", str, "")
    try:
        is_date = not text or datetime.fromisoformat(text).tzinfo is not None
    except ValueError:
        is_date = False
    if not is_date:
        raise ModelFileError(
            f"{table.where}: made_at = {text!r} is not a date, ISO 8601 with offset from UTC."
        )
    return text
