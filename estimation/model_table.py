"""A table of a model file, read key by key, so that unknown keys are reported."""

import math
from collections.abc import Iterable, Mapping
from typing import Any

from estimation.errors import UnknownNameError
from estimation.model import ModelError, nearest


class ModelFileError(ModelError):
    """A model file cannot be read; the message names the file and the key."""


class NoModelError(ModelFileError, UnknownNameError):
    """There is no model of that name, and no such file."""


class Table:
    """A TOML table that records which of its keys were read.

    Args:
        content: The table as `tomllib` reads it.
        where: File and key, for messages.
    """

    def __init__(self, content: Mapping[str, Any], where: str) -> None:
        self.content = content
        self.where = where
        self._read: list[str] = []

    def take(self, key: str, kind: type, default: Any = None) -> Any:
        """Return a value of a type, or the default where one is given and the key is not there."""
        self._read.append(key)
        if key not in self.content and default is not None:
            return default
        if key not in self.content:
            near = nearest(key, list(self.content)) if self.content else ""
            raise ModelFileError(f"{self.where} lacks the key {key!r}.", near)
        value = self.content[key]
        if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
            raise ModelFileError(f"{self.where}: {key} = {value!r} is not {kind.__name__}.")
        return value

    def number(self, key: str, default: float | None = None) -> float:
        """Return a finite number."""
        if isinstance(self.content.get(key), int):
            return float(self.take(key, int))
        value: float = self.take(key, float, default)
        if not math.isfinite(value):
            raise ModelFileError(f"{self.where}: {key} = {value} is not a finite number.")
        return value

    def table(self, key: str) -> "Table":
        """Return a table within this one; an empty one where there is none."""
        return Table(self.take(key, dict, {}), f"{self.where}, {key}")

    def tables(self, key: str) -> Iterable["Table"]:
        """Yield the tables of an array of tables."""
        for index, entry in enumerate(self.take(key, list), start=1):
            if not isinstance(entry, dict):
                raise ModelFileError(f"{self.where}: {key} holds {entry!r}, not a table.")
            yield Table(entry, f"{self.where}, {key} {index}")

    def finish(self) -> None:
        """Raise for the first key that nothing has read."""
        for key in self.content:
            if key not in self._read:
                raise ModelFileError(
                    f"{self.where} has an unknown key {key!r}.", fix=nearest(key, self._read)
                )
