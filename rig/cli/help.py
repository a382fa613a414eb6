"""How a list of commands is shown: grouped by what a person is about, each line in full."""

from typing import Any

import typer
from typer.core import TyperGroup


class GroupedHelp(TyperGroup):
    """A group of commands whose help shows them under their headings, with whole sentences."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the commands of each heading, `Commands` for those of none."""
        commands = {name: self.get_command(ctx, name) for name in self.list_commands(ctx)}
        width = max(map(len, commands), default=0)
        headings: dict[str, list[tuple[str, str]]] = {}
        for name, command in commands.items():
            if command is not None and not command.hidden:
                row = (name.ljust(width), command.get_short_help_str(limit=1000))
                heading = getattr(command, "rich_help_panel", None)
                known = heading if isinstance(heading, str) else "Commands"
                headings.setdefault(known, []).append(row)
        for heading, rows in headings.items():
            with formatter.section(heading):
                formatter.write_dl(rows)


def group(name: str, help_: str, **options: Any) -> typer.Typer:
    """Return a group of commands; without one of them it shows its help."""
    options = {"no_args_is_help": True} | options
    return typer.Typer(name=name, help=help_, cls=GroupedHelp, rich_markup_mode=None, **options)
