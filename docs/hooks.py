"""Pages of the site made from the code: effects, and keys of configurations and protocols."""

import inspect
import re
from collections.abc import Iterator
from typing import Any

from mkdocs.structure.files import File, Files
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from estimation.channels import UnknownUnitError, unit_of
from estimation.effects import catalogue
from rig.configuration.config import Config
from rig.configuration.machine_settings import settings_of
from rig.configuration.sections import profiles
from rig.protocols.protocol import SHIPPED, TABLES

OF_A_MACHINE = ("limits", "drift", "machine")
"""Tables whose keys depend on `[logger] profile`."""


def on_files(files: Files, *, config: Any) -> Files:
    """Add the pages to the site."""
    pages = {"effects": effects, "configuration": configuration, "protocols": protocols}
    for name, text in pages.items():
        files.append(File.generated(config, f"{name}.md", content=text()))
    return files


def effects() -> str:
    """Return the page of all effects, in Markdown."""
    known = catalogue()
    lines = [
        "# Effects",
        "",
        f"All {len(known)} effects that a model may contain, from their own descriptions."
        " `rig effects NAME` prints one of them. To add one: [adding to it](extending.md).",
    ]
    for name, one in known.items():
        lines += ["", f"## {name}", "", inspect.cleandoc(type(one).__doc__ or "")]
        parameters = [f"`{p.name}` ({p.unit})" for p in (*one.amplitudes, *one.shape)]
        lines += ["", f"Parameters: {', '.join(parameters)}.", ""]
        lines.append(
            f"Searched in: {', '.join(one.balances) or 'no equation; it is declared only'}."
        )
        if one.told_apart_by:
            lines += ["", f"Distinguished by: {one.told_apart_by}."]
    return "\n".join(lines) + "\n"


def configuration() -> str:
    """Return the page of all keys of a configuration, in Markdown."""
    lines = [
        "# Configuration",
        "",
        "One TOML file describes a rig. `rig config init` writes one to begin with, `rig config"
        " check` names every problem with its line, `rig config show` prints every key with its"
        " value.",
        "",
        "## At the top",
        "",
    ]
    tables = {k: f for k, f in Config.model_fields.items() if _section(f) or k in OF_A_MACHINE}
    lines += _table(Config, [key for key in Config.model_fields if key not in tables])
    for key, field in tables.items():
        if key in OF_A_MACHINE:
            for profile in profiles():
                kinds = settings_of(profile)
                kind = {"limits": kinds.limits, "drift": kinds.drift, "machine": kinds.own}[key]
                if kind.model_fields:
                    lines += ["", f"## [{key}], profile {profile}", "", *_described(kind)]
            continue
        if (section := _section(field)) is None:
            continue
        title = f"[{key}.NAME]" if key == "devices" else f"[{key}]"
        lines += ["", f"## {title}", "", *_described(section)]
    return "\n".join(lines) + "\n"


def protocols() -> str:
    """Return the page of all keys of a protocol, in Markdown."""
    lines = [
        "# Protocols",
        "",
        "A protocol is a TOML file: `name`, `description`, and `[[runs]]` tables. Each table has a"
        " `kind`; it expands into one run for every combination of its lists and for every repeat."
        " `rig record --protocol FILE` records it. The shipped `quick`:",
        "",
        "```toml",
        (SHIPPED / "quick.toml").read_text().rstrip(),
        "```",
    ]
    for table in TABLES:
        (kind,) = table.model_fields["kind"].annotation.__args__  # type: ignore[union-attr]
        own = [key for key in table.model_fields if key != "kind"]
        lines += ["", f'## kind = "{kind}"', "", inspect.cleandoc(table.__doc__ or ""), ""]
        lines += _table(table, own)
    return "\n".join(lines) + "\n"


def _section(field: FieldInfo) -> type[BaseModel] | None:
    """Return the table that a key holds, also where it holds several by name."""
    for kind in (field.annotation, *getattr(field.annotation, "__args__", ())):
        if inspect.isclass(kind) and issubclass(kind, BaseModel):
            return kind
    return None


def _described(section: type[BaseModel]) -> Iterator[str]:
    yield inspect.cleandoc(section.__doc__ or "").split("\n\nAttributes:")[0]
    yield ""
    yield from _table(section, list(section.model_fields))


def _table(section: type[BaseModel], keys: list[str]) -> Iterator[str]:
    meanings = _attributes(section)
    yield "| key | default | unit | meaning |"
    yield "|---|---|---|---|"
    for key in keys:
        field = section.model_fields[key]
        default = "required" if field.is_required() else _value(field)
        yield f"| `{key}` | {default} | {_unit(key)} | {meanings.get(key, '')} |"


def _value(field: FieldInfo) -> str:
    value = field.get_default(call_default_factory=True)
    return "" if value in (None, {}) else f"`{str(value).lower() if value is True else value}`"


def _unit(key: str) -> str:
    try:
        unit = unit_of(key)
    except UnknownUnitError:
        return ""
    return "" if unit == "1" else unit


def _attributes(section: type[BaseModel]) -> dict[str, str]:
    """Return the meaning of each key, from the docstring."""
    text = inspect.cleandoc(section.__doc__ or "").partition("Attributes:\n")[2]
    found = re.findall(r"^    (\w+): (.*(?:\n {8}.*)*)", text, re.MULTILINE)
    return {key: " ".join(meaning.split()) for key, meaning in found}
