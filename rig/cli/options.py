"""What commands share: options, the names they complete, the rig they choose, how help is shown."""

import math
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer import Argument, Option
from typer.core import TyperGroup

import estimation
import rig
from rig.errors import UsageError
from rig.output.console import remarks

if TYPE_CHECKING:
    from estimation.campaign import Campaign
    from rig.configuration.config import Config

SHIPPED, DECLARED = Path(rig.__file__).parent, Path(estimation.__file__).parent


def _names(*folders: Path) -> list[str]:
    return sorted(path.stem for folder in folders for path in folder.glob("*.toml"))


def config_names() -> list[str]:
    """Return the names of the shipped configurations."""
    names = _names(SHIPPED / "configuration" / "shipped")
    return [name for name in names if not name.endswith(".model")]


def protocol_names() -> list[str]:
    """Return the names of the shipped protocols."""
    return _names(SHIPPED / "protocols")


def model_names() -> list[str]:
    """Return the names of the shipped declared models."""
    from estimation.plant_equations import equations
    from estimation.plant_file import shipped_plant

    own = [equation.name for equation in equations(shipped_plant("reference"))]
    return sorted([*_names(DECLARED / "models"), *own])


def machine_names() -> list[str]:
    """Return the names of the shipped machines."""
    return _names(DECLARED / "machines", SHIPPED / "machines" / "examples")


def _fitted_names() -> list[str]:
    from rig.cli.model import fitted_models

    return list(fitted_models())


def _effect_names() -> list[str]:
    from estimation.effects import catalogue

    return list(catalogue())


def _campaigns() -> list[Path]:
    """Return the folders of logs in `logs/`, the latest name first."""
    logs = Path("logs")
    folders = {path.parent for depth in ("*", "*/*") for path in logs.glob(f"{depth}/*.mcap")}
    return sorted(folders, reverse=True)


def _completed(names: Callable[[], list[str]], pattern: str = "") -> Callable[[str], list[str]]:
    """Return a completion of names, and with a pattern of paths."""

    def complete(incomplete: str) -> list[str]:
        typed = Path(incomplete or ".")
        folder = typed if incomplete.endswith("/") or not incomplete else typed.parent
        files = sorted(map(str, folder.glob(pattern))) if pattern and folder.is_dir() else []
        return [name for name in dict.fromkeys([*names(), *files]) if name.startswith(incomplete)]

    return complete


complete_config = _completed(config_names, "*.toml")
complete_protocol = _completed(protocol_names, "*.toml")
complete_machine = _completed(machine_names, "*.toml")
complete_model = _completed(model_names, "*.toml")
complete_fitted = _completed(_fitted_names, "*.toml")
complete_effect = _completed(_effect_names)
complete_recordings = _completed(lambda: list(map(str, _campaigns())), "*")
complete_campaign = _completed(lambda: [str(f.relative_to("logs")) for f in _campaigns()])

# the equations are not worked out here: every command would read the machine's file for it
DECLARED_MODEL = (
    f"a file, one of {', '.join(_names(DECLARED / 'models'))}, or an equation of the reference rig,"
    " such as motor"
)
"""What names a declared model, for helps."""

ConfigOption = Annotated[
    Path | None,
    Option(
        "--config",
        "-c",
        help=f"Configuration: a file, or one of {', '.join(config_names())}. If none: RIG_CONFIG,"
        " ./rig.toml, ~/.config/rig/rig.toml.",
        autocompletion=complete_config,
    ),
]
SimFlag = Annotated[bool, Option("--sim", help="Use the simulated rig; nothing real moves.")]
MachineOption = Annotated[
    Path | None,
    Option(
        "--machine",
        help=f"Machine of the recordings: a file, or one of {', '.join(machine_names())}. If none:"
        " the reference rig.",
        autocompletion=complete_machine,
    ),
]
ModelOption = Annotated[
    Path | None,
    Option(
        "--model",
        "-m",
        help=f"Declared model: {DECLARED_MODEL}.",
        autocompletion=complete_model,
    ),
]
RecordingsArgument = Annotated[
    Path,
    Argument(help="Recordings: a file, folder or archive.", autocompletion=complete_recordings),
]
FormatOption = Annotated[
    str | None, Option("--format", help="Format of the recordings; detected by default.")
]
SkipBad = Annotated[
    bool, Option("--skip-bad", help="Leave out runs that cannot be read, and name them.")
]
ExcludeOption = Annotated[
    list[str] | None, Option("--exclude", help="Run to exclude; may be given several times.")
]
EquationOption = Annotated[
    str | None, Option("--equation", help="Only this equation, such as motor.")
]
LedgerOption = Annotated[Path | None, Option(help="Path of the held-out-data usage log.")]
JsonFile = Annotated[Path | None, Option("--json-out", help="File for the result as JSON.")]
QuickFlag = Annotated[bool, Option("--quick", help="Propose no next experiment.")]
PlainFlag = Annotated[bool, Option("--plain", help="Lines instead of the display.")]
OutFolder = Annotated[Path | None, Option("--out", "-o", help="Folder of all output.")]
LiveModel = Annotated[
    Path | None, Option(help="Model file of the estimate; by default the configured one.")
]
ReplayModel = Annotated[
    Path | None, Option(help="Model file of the estimate; by default the one in use for the rig.")
]
WorkersOption = Annotated[
    int, Option("--workers", min=1, help="Number of processes; 1 is this one.")
]
SchedulerOption = Annotated[str | None, Option(help="Address of a Dask scheduler.")]
SeedOption = Annotated[int, Option(help="Seed of everything random, such as the folds.")]
SimulationSeed = Annotated[
    int | None, Option("--seed", help="Seed of the simulated rig; by default by the clock.")
]
TablesFile = Annotated[Path | None, Option("--out", help="File for the tables, in Markdown.")]
FiguresFolder = Annotated[Path | None, Option(help="Folder for the figures, as SVG.")]


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


def chosen_rig(config: Path | None, sim: bool) -> "Config":
    """Return the chosen configuration, and say on stderr if it is a simulated rig's."""
    from rig.configuration.chosen import choose_rig

    return announced(choose_rig(config, sim))


def announced(settings: "Config") -> "Config":
    """Return a configuration; the session on it begins with a line if it is simulated."""
    if settings.is_simulated:
        remarks().print(f"Simulated rig ({settings.name}): nothing real moves or is measured.")
    return settings


def require_yes(question: str, yes: bool) -> None:
    """Ask a person at the terminal, unless `--yes` was given; no for an answer ends the command."""
    if yes:
        return
    if not sys.stdin.isatty():
        raise UsageError(
            f"Nobody can answer: {question}",
            "stdin is not a terminal.",
            "Run it in a terminal, or add --yes.",
        )
    typer.confirm(question, abort=True, err=True)


def require_number(option: str, value: float | None, least: float) -> None:
    """Refuse a number that is not finite or is below the least; None where none was given."""
    if value is not None and not least <= value < math.inf:
        raise UsageError(
            f"{option} {value:g} cannot be used.", fix=f"Give a finite number from {least:g} on."
        )


def require_new(path: Path | None) -> None:
    """Refuse to write over a file that is there, None for no file.

    Pages, figures and results as JSON are replaced, see `estimation.files`; nothing else is.
    """
    if path is not None and path.exists():
        raise UsageError(f"{path} is there already.", fix="Name another file.")


def require_machine(file: Path | None) -> None:
    """Refuse a machine file with an error, before the libraries are loaded, which takes seconds."""
    from rig.machines.shipped import read_machine

    if file is not None:
        read_machine(file)


def without(path: Path, campaign: "Campaign", names: list[str] | None) -> "Campaign":
    """Return a campaign in which runs are excluded too, and print on stderr all that are.

    Raises:
        CampaignError: The campaign has no such run.
    """
    campaign = campaign.exclude(dict.fromkeys(names or (), "--exclude"))
    say_left_out(path, campaign)
    return campaign


def say_left_out(path: Path, campaign: "Campaign") -> None:
    """Print on stderr the files and runs at a path that a campaign excludes, with the reason."""
    from rig.importers.registry import left_out

    for line in left_out(path, campaign):
        remarks().print(line)
