"""A resolved configuration as TOML text, with every default and every unit."""

import json
from collections.abc import Iterator, Mapping
from typing import Any

from estimation.channels import UnknownUnitError, unit_of
from rig.configuration.config import Config


def to_toml(config: Config) -> str:
    """Return the configuration as TOML that `load_config` reads back to the same configuration."""
    return "\n".join(_table((), config.model_dump())).strip() + "\n"


def _table(path: tuple[str, ...], values: Mapping[str, Any]) -> Iterator[str]:
    """Yield a table's lines: its own keys, then the tables inside it; keys without a value last."""
    own = {k: v for k, v in values.items() if not isinstance(v, Mapping)}
    inner = {k: v for k, v in values.items() if isinstance(v, Mapping)}
    if path and (own or not inner):
        yield ""
        yield f"[{'.'.join(_key(part) for part in path)}]"
    for key, value in own.items():
        yield (
            f"# {_key(key)} is not set" if value is None else f"{_key(key)} = {_value(key, value)}"
        )
    for key, table in inner.items():
        yield from _table((*path, key), table)


def _value(key: str, value: Any) -> str:
    text = json.dumps(value)  # of strings, numbers, truth values and lists: TOML's own form
    try:
        unit = unit_of(key)
    except UnknownUnitError:
        return text
    return text if unit == "1" else f"{text}  # {unit}"


def _key(name: str) -> str:
    return name if name.replace("_", "").replace("-", "").isalnum() else json.dumps(name)
