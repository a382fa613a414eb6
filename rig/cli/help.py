"""How a list of commands is shown: grouped by what a person is about, each line in full."""

from typing import Any

from typer.core import TyperGroup

GROUPS = {
    "Begin": (
        "demo",
        "config",
        "machine",
        "doctor",
        "devices",
        "selftest",
        "commission",
        "udev",
        "firmware",
    ),
    "At the rig": (
        "live",
        "record",
        "grip",
        "stop",
        "clear",
        "reference",
        "calibrate",
        "cal",
        "grasper",
    ),
    "Recordings": ("campaigns", "import", "log", "replay", "view"),
    "Models": (
        "fit",
        "diagnose",
        "model",
        "diff",
        "loop",
        "effects",
        "adapt",
        "estimator",
        "export",
    ),
    "Papers": ("study",),
}
"""Headings of the top list and the commands under each; others stand under `Commands`."""


class GroupedHelp(TyperGroup):
    """A group of commands whose help shows them under headings, with whole sentences."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the commands of each heading, then those of none."""
        commands = {name: self.get_command(ctx, name) for name in self.list_commands(ctx)}
        rows = {
            name: (name, command.get_short_help_str(limit=1000))
            for name, command in commands.items()
            if command is not None and not command.hidden
        }
        grouped = {name for names in GROUPS.values() for name in names}
        is_top = ctx.parent is None
        rest = tuple(name for name in rows if not is_top or name not in grouped)
        headings = {**(GROUPS if is_top else {}), "Commands": rest}
        width = max((len(name) for name in rows), default=0)
        for heading, names in headings.items():
            shown = [rows[name] for name in names if name in rows]
            if shown:
                with formatter.section(heading):
                    formatter.write_dl([(name.ljust(width), text) for name, text in shown])
