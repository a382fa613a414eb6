"""Reading a mapping from a machine's file and the command line, with the place of each entry."""

import tomllib
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray
from pydantic import ValidationError

from estimation.channels import UNIT_BY_SUFFIX, UnknownUnitError, ending_of, unit_of
from estimation.derived import origin_of
from estimation.files import not_utf8
from rig.configuration.validation import explain, line_of
from rig.errors import DataError, UsageError
from rig.importers.table.data import DATE, TIME, Data, Invalid, Runs, Section, Source
from rig.importers.table.formula import FormulaError, evaluate, names_in
from rig.importers.table.units import NotAUnitError, conversion


class _Whole(Section):
    data: Data


@dataclass(frozen=True)
class ColumnMapping:
    """A mapping, and where each of its entries is written."""

    data: Data
    file: Path | None = None
    text: str = ""
    # path of an entry to the words of the command line that state it
    flags: Mapping[tuple[str, ...], str] = field(default_factory=dict)

    def where(self, *path: str | int) -> str:
        """Return where an entry stands, such as `drive.toml, line 12`."""
        keys = tuple(str(key) for key in path)
        for length in range(len(keys), 0, -1):
            if keys[:length] in self.flags:
                return self.flags[keys[:length]]
        number = line_of(self.text, ("data", *path))
        name = self.file.name if self.file else "the command line"
        return f"{name}, line {number}" if number else name

    @property
    def name(self) -> str:
        """Name of the machine: its file's."""
        return self.file.stem if self.file else ""


def read_mapping(
    file: Path | None, flags: Sequence[tuple[tuple[str, ...], Any, str]]
) -> ColumnMapping:
    """Read the mapping of a machine's file, if any, and of the command line, which comes first.

    `flags` has for each entry of the command line its path below `[data]`, value and words.

    Raises:
        UsageError: A file is not there or not TOML, a key is unknown or wrong, a unit does not fit.
    """
    text, content = _content(file) if file else ("", {})
    words: dict[tuple[str, ...], str] = {}
    for path, value, typed in flags:
        if path in words:
            raise UsageError(
                f"{path[-1]} is stated twice: {words[path]} and {typed}.", fix="Keep one of them."
            )
        words[path] = typed
        table = content
        for key in path[:-1]:
            table = table.setdefault(key, {})
        table[path[-1]] = value
    try:
        data = _Whole.model_validate({"data": content}).data
    except ValidationError as error:
        raise _wrong(error, file, text) from error
    mapping = ColumnMapping(data, file, text, words)
    _check(mapping)
    return mapping


def _content(file: Path) -> tuple[str, dict[str, Any]]:
    try:
        text = file.read_text("utf-8")
        content = tomllib.loads(text)
    except UnicodeDecodeError as error:
        raise UsageError(f"{file} is not a machine file.", *not_utf8(error)) from error
    except (OSError, tomllib.TOMLDecodeError) as error:
        hint = ""
        if "overwrite" in str(error):
            hint = "Two lines state the same key, such as one channel twice: delete one of them."
        raise UsageError(f"{file} is not a machine file: {error}.", fix=hint) from error
    data = content.get("data")
    if not isinstance(data, dict):
        raise UsageError(
            f"{file} has no table [data].",
            "It maps the columns of a recording to channels.",
            'Add [data.columns] with lines such as motor_angle_rad = "COLUMN:deg".',
        )
    return text, data


def _wrong(error: ValidationError, file: Path | None, text: str) -> UsageError:
    known = [*Data.model_fields, *Source.model_fields, *Runs.model_fields, *Invalid.model_fields]
    return UsageError(
        f"{file.name if file else 'The command line'}: {explain(error, known, text)}",
        fix="See docs/your-own-machine.md for every key of [data].",
    )


def _check(mapping: ColumnMapping) -> None:
    data = mapping.data
    if TIME in data.columns and data.sample_rate_hz is not None:
        what = "Time is stated twice: by a column for time_s and by a sample rate."
        raise UsageError(what, fix="Keep one of them.")
    if data.columns and TIME not in data.columns and data.sample_rate_hz is None:
        raise UsageError(
            f"{mapping.where('columns')}: nothing states the time of the samples.",
            fix='Map a column, time_s = "COLUMN:ms", or state sample_rate_hz (--rate).',
        )
    for part in ("columns", "conditions"):
        for name, source in getattr(data, part).items():
            _check_source(mapping, part, name, source)
    for name, formula in data.formulas.items():
        where = mapping.where("formulas", name)
        if name in data.columns or name in data.conditions:
            raise UsageError(f"{where}: {name} is mapped to a column, too.", fix="Keep one.")
        _formula(where, formula)
    for number, invalid in enumerate(data.invalid):
        _formula(mapping.where("invalid", number, "when"), invalid.when)


def _formula(where: str, formula: str) -> None:
    try:
        names_in(formula)
    except FormulaError as error:
        raise UsageError(f"{where}: {error}.") from error


def worked_out(
    where: str, formula: str, known: Mapping[str, Any], shape: tuple[int, ...], kind: DTypeLike
) -> NDArray[Any]:
    """Return the values of a formula of the mapping, of this shape and type, not to be changed.

    Raises:
        UsageError: It reads a name that is neither a channel nor a condition, or is not a formula.
        DataError: Its values are not of the type.
    """
    lacking = [name for name in names_in(formula) if name not in known]
    if not lacking:
        try:
            return np.broadcast_to(np.asarray(evaluate(formula, known), dtype=kind), shape)
        except FormulaError as error:
            raise UsageError(f"{where}: {error}.", f"There are {', '.join(known)}.") from error
        except (ValueError, TypeError) as error:
            raise DataError(f"{where}: {error}.", f"There are {', '.join(known)}.") from error
    fix = ""
    origin, times = origin_of(lacking[0])
    if times:
        fix = (
            f"Let an effect of an [[equation]] read {lacking[0]}: it is differentiated there."
            f" For its product with a condition, write a formula scaled_{origin}, {origin} times"
            f" the condition, and let the effect read scaled_{lacking[0]}."
        )
    raise UsageError(
        f"{where}: no channel or condition is called {lacking[0]!r}.",
        f"Formulas read columns and conditions only. There are {', '.join(known)}.",
        fix,
    )


def _check_source(mapping: ColumnMapping, part: str, name: str, source: Source) -> None:
    where = mapping.where(part, name)
    if part == "columns" and source.value is not None:
        raise UsageError(f"{where}: a channel has a column, not a value.", fix="Write column = .")
    if not source.column and source.value is None:
        raise UsageError(f"{where}: {name} has no column.", fix=f'Write {name} = "COLUMN:UNIT".')
    try:
        own = unit_of(name)
    except UnknownUnitError as error:
        if part == "conditions" and not source.unit:
            return
        raise UsageError(
            f"{where}: the name {name!r} has no unit at its end.",
            "Channels are in SI units, and their names end in the unit: "
            f"{', '.join(f'_{suffix}' for suffix in UNIT_BY_SUFFIX)}.",
            f"Rename it, {_example(name, source.unit)}.",
        ) from error
    if source.unit in ("", DATE) and (name == TIME or source.unit == ""):
        return
    try:
        fits = conversion(source.unit, name) is not None
    except NotAUnitError as error:
        raise UsageError(
            f"{where}: {error}.",
            f"{name} is in {own}.",
            "Write a unit such as deg, rpm, mm, mA, rev/4096 or 0.4/255 A; see"
            " docs/your-own-machine.md.",
        ) from error
    if not fits:
        raise UsageError(
            f"{where}: {source.unit!r} is not a unit of {name}, which is in {own}.",
            fix=f"Write a unit of {own}, or the name {_renamed(name, source.unit)}."
            if source.unit not in ("count", "counts")
            else "Write the size of a count, such as rev/4096, 0.01 mm or 0.4/255 A.",
        )


def _renamed(name: str, unit: str) -> str:
    """Return a name like this one that a unit fits, or an example."""
    suffix = _suffix_of(unit)
    stem = name.removesuffix(ending_of(name))
    return f"{stem}{suffix}" if suffix else "one of the suffixes of docs/signs-and-units.md"


def _example(name: str, unit: str) -> str:
    """Return an example of a name with a unit at its end, for one without."""
    suffix = _suffix_of(unit) if unit and unit != DATE else ""
    if suffix:
        return f"for example {name}_{suffix}"
    return f"such as {name}_rad of an angle or {name}_a of a current"


def _suffix_of(unit: str) -> str:
    """Return the suffix of channels that a unit fits; nothing where none does."""
    with suppress(NotAUnitError):
        for suffix in sorted(UNIT_BY_SUFFIX, key=len):
            if conversion(unit, f"_{suffix}") is not None:
                return suffix
    return ""
