"""A table of a TOML file, read key by key so that unknown keys are reported, and values as TOML."""

import difflib
import json
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields
from typing import TYPE_CHECKING, Any, Literal, TypeVar, get_args, get_origin, get_type_hints

from estimation.errors import EstimationError, nearest

HEADER = re.compile(r"^\s*(\[\[?)\s*([\w.\-]+)\s*\]\]?")
KEY = re.compile(r"^\s*([\w\-]+)\s*(?:\.[\w.\-]+\s*)?=")

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

T = TypeVar("T", bound="DataclassInstance")

KINDS: Mapping[type, tuple[str, str]] = {
    bool: ("true or false", "true, or false"),
    str: ("a text in quotes", '"..."'),
    int: ("a whole number", "1"),
    float: ("a number", "1.0"),
    list: ("a list", "[...]"),
    dict: ("a table", "{ ... }"),
}
"""Type of a value to its name and an example, for messages."""

Place = tuple[str, int, str]
"""A table's name, which one of that name (from 1), and a key; the key is empty for the header."""


class TableError(EstimationError):
    """A key of a TOML file is missing, unknown or wrong; the message names the file and the key."""


class Lines:
    """The lines of a TOML text's tables and keys; a table within a table is named with dots."""

    def __init__(self, text: str) -> None:
        self._line: dict[Place, int] = {}
        count: dict[str, int] = {}
        at: tuple[str, int] = ("", 1)
        for number, line in enumerate(text.splitlines(), start=1):
            if header := HEADER.match(line):
                name = header[2]
                count[name] = count.get(name, 0) + 1
                at = (name, count[name])
                self._line[(*at, "")] = number
            elif key := KEY.match(line):
                self._line.setdefault((*at, key[1]), number)

        self._named: dict[str, int] = {}

    def following(self, name: str) -> int:
        """Return which table of a name is read next; tables are read in the file's order."""
        self._named[name] = self._named.get(name, 0) + 1
        return self._named[name]

    def of(self, place: Place) -> int | None:
        """Return the line of a key, the table's header where the key is not there, or None."""
        name, index, key = place
        table = f"{name}.{key}" if name else key
        found = self._line.get(place) or self._line.get((table, 1, ""))
        return found or self._line.get((name, index, ""))


@dataclass
class Table:
    """A TOML table that records which of its keys were read."""

    content: Mapping[str, Any]  # the table as `tomllib` reads it
    where: str  # file and table, for messages
    error: type[EstimationError] = TableError  # what is raised
    # lines of the file's tables and keys, for messages that name the line
    lines: Lines | None = None
    place: tuple[str, int] = ("", 1)  # the table's name in `lines`, and which one of that name
    file: str = ""  # the file, for messages that name a line
    _read: list[str] = field(default_factory=list)

    def at(self, key: str = "") -> str:
        """Return where a key stands, for a message."""
        line = self.lines.of((*self.place, key)) if self.lines else None
        return self.where if line is None else f"{self.file or self.where}, line {line}"

    def take(self, key: str, kind: type, default: Any = None) -> Any:
        """Return a value of a type, or the default where one is given and the key is not there."""
        self._read.append(key)
        if key not in self.content and default is not None:
            return default
        if key not in self.content:
            near = difflib.get_close_matches(key, self.content, n=1)
            fix = f"Did you mean {near[0]!r}?" if near else f"Write {key} = ... there."
            raise self.error(f"{self.at()} lacks the key {key!r}.", fix=fix)
        value = self.content[key]
        if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
            name, example = KINDS[kind]
            raise self.error(
                f"{self.at(key)}: {key} = {value_text(value)} is not {name}.",
                fix=f"Write {key} = {example}.",
            )
        return value

    def number(self, key: str, default: float | None = None) -> float:
        """Return a finite number."""
        if isinstance(self.content.get(key), int):
            return float(self.take(key, int))
        value: float = self.take(key, float, default)
        if not math.isfinite(value):
            raise self.error(f"{self.at(key)}: {key} = {value} is not a finite number.")
        return value

    def choice(self, key: str, allowed: Sequence[str]) -> str:
        """Return one of a few words, the first of them where the key is not there."""
        word: str = self.take(key, str, allowed[0])
        if word not in allowed:
            known = [one for one in allowed if one]
            raise self.error(
                f"{self.at(key)}: {key} = {word!r} is none of {', '.join(known)}.",
                fix=nearest(word, known),
            )
        return word

    def made(self, kind: type[T], **known: Any) -> T:
        """Return a dataclass whose fields are keys of this table, or of known values.

        A field is read as it is annotated: str, bool, int, float, float | None or one of few words.
        A key of a field with a default may be left out. An unknown key is an error.
        """
        types = get_type_hints(kind)
        for each in fields(kind):
            if each.name in known:
                continue
            self.ignore(each.name)
            if each.name in self.content or each.default is MISSING:
                known[each.name] = self._typed(each.name, types[each.name])
        self.finish()
        return kind(**known)

    def _typed(self, key: str, kind: Any) -> Any:
        if get_origin(kind) is Literal:
            return self.choice(key, get_args(kind))
        return self.take(key, kind) if kind in (str, bool, int) else self.number(key)

    def table(self, key: str) -> "Table":
        """Return a table within this one; an empty one where there is none."""
        return self._within(self.take(key, dict, {}), f"{self.where}, {key}", key, 1)

    def tables(self, key: str, default: list[Any] | None = None) -> Iterable["Table"]:
        """Yield the tables of an array of tables."""
        for index, entry in enumerate(self.take(key, list, default), start=1):
            if not isinstance(entry, dict):
                raise self.error(f"{self.at(key)}: {key} holds {entry!r}, not a table.")
            name = f"{self.place[0]}.{key}" if self.place[0] else key
            number = self.lines.following(name) if self.lines else index
            yield self._within(entry, f"{self.where}, {key} {index}", key, number)

    def _within(self, content: Mapping[str, Any], where: str, key: str, index: int) -> "Table":
        name = f"{self.place[0]}.{key}" if self.place[0] else key
        return Table(content, where, self.error, self.lines, (name, index), self.file or self.where)

    def ignore(self, key: str) -> None:
        """Accept a key that somebody else reads."""
        self._read.append(key)

    def finish(self) -> None:
        """Raise for the first key that nothing has read."""
        for key in self.content:
            if key not in self._read:
                raise self.error(
                    f"{self.at(key)} has an unknown key {key!r}.",
                    fix=nearest(key, list(dict.fromkeys(self._read))),
                )


def entries(content: Mapping[str, Any], within: str = "") -> list[str]:
    """Return the lines of a table's keys, without those whose value is None.

    `within` is what stands before each key, such as `channels.`.
    """
    return [f"{within}{key} = {value_text(v)}" for key, v in content.items() if v is not None]


def value_text(value: Any) -> str:
    """Return a value as TOML; TableError for a number that is not finite.

    A JSON string is a TOML basic string but for DEL.
    """
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {value_text(v)}" for key, v in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(value_text(item) for item in value) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float) and not math.isfinite(value):
        raise TableError(f"A file cannot hold the value {value}.")
    return repr(value)
