"""The `rig` command: collects the verbs and turns errors into three lines and an exit code."""

import os
import shlex
import signal
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from io import TextIOWrapper
from pathlib import Path
from types import FrameType
from typing import Annotated, Any

import typer
from typer import Option
from typer.exceptions import TyperException

from rig import __version__
from rig.cli.board import clear, reference, stop
from rig.cli.calibrate import calibrate_app
from rig.cli.campaigns import campaigns
from rig.cli.config import config_app
from rig.cli.demo import demo
from rig.cli.diagnose import diagnose, diff, loop
from rig.cli.doctor import commission, devices, doctor, firmware_app, selftest, udev
from rig.cli.effects import effects
from rig.cli.estimator import adapt, estimator_app, export
from rig.cli.fit import fit
from rig.cli.grasper import grasper_app
from rig.cli.grip import grip
from rig.cli.import_ import import_
from rig.cli.live import live, replay
from rig.cli.log import log_app
from rig.cli.machine import machine_app
from rig.cli.model import model_app
from rig.cli.options import GroupedHelp
from rig.cli.record import record
from rig.cli.study import study_app
from rig.cli.view import view

# before numpy is loaded: the matrices are small, and threads of a BLAS wait for one another
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

COMMANDS: dict[str, tuple[Callable[..., Any] | typer.Typer, ...]] = {
    "Begin": (
        *(demo, config_app, machine_app),
        *(doctor, devices, selftest, commission, udev, firmware_app),
    ),
    "At the rig": (live, record, grip, stop, clear, reference, calibrate_app, grasper_app),
    "Recordings": (campaigns, import_, log_app, replay, view),
    "Models": (fit, diagnose, model_app, diff, loop, effects, adapt, estimator_app, export),
    "Papers": (study_app,),
}
"""Headings of the list of commands, and the commands under each, in order."""


def _name(member: Callable[..., Any] | typer.Typer) -> str:
    return str(member.info.name) if isinstance(member, typer.Typer) else member.__name__.rstrip("_")


class OrderedHelp(GroupedHelp):
    """The commands in the order of the list above."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names of all commands."""
        return [_name(member) for members in COMMANDS.values() for member in members]


app = typer.Typer(
    name="rig",
    help="Record, estimate and explain the torque at the jaw of a surgical-grasper rig.",
    cls=OrderedHelp,
    invoke_without_command=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # plain help keeps the start instant
    epilog="Exit codes: 0 done, 1 bad result, 2 usage, 3 device, 4 safety trip, 5 damaged data, "
    "70 bug, 130 interrupted.",
)

for heading, members in COMMANDS.items():
    for member in members:
        if isinstance(member, typer.Typer):
            app.add_typer(member, rich_help_panel=heading)
        else:
            app.command(_name(member), rich_help_panel=heading)(member)
app.add_typer(calibrate_app, name="cal", hidden=True)  # the name it had


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"rig {__version__}")
        raise typer.Exit


@app.callback()
def options(
    context: typer.Context,
    debug: Annotated[bool, Option(help="Show the traceback of an error.")] = False,
    version: Annotated[
        bool, Option("--version", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    """Take the options that stand before the verb; `main` reads them from the command line."""
    if context.invoked_subcommand is None:
        from rig.cli.next_steps import show_next_steps

        show_next_steps()


@cache
def _commands() -> Any:
    return typer.main.get_command(app)


def main(arguments: list[str] | None = None) -> int:
    """Run the command line, without arguments the process' own, and return its exit code."""
    words = sys.argv[1:] if arguments is None else arguments
    try:
        result = _commands()(args=words, standalone_mode=False, prog_name="rig")
    except typer.Exit as stop:
        return stop.exit_code
    except SystemExit:  # how typer and rich exit when the reader of stdout is closed
        return 141
    except (KeyboardInterrupt, typer.Abort):
        result = 130
    except Exception as error:
        if not _is_of_interrupt(error):
            return _report(error, words)
        result = 130
    if result == 130:  # as typer returns after Ctrl-C
        sys.stderr.write("Interrupted.\n")
    return int(result) if isinstance(result, int) else 0


def _of_the_computer(error: OSError) -> Exception:
    """Return the refusal of a file by the computer in words, else the error itself."""
    from errno import EACCES, EDQUOT, EIO, EISDIR, ENOSPC, ENOTDIR, EPERM, EROFS

    from estimation.files import OutputError

    if error.errno not in (EACCES, EDQUOT, EIO, EISDIR, ENOSPC, ENOTDIR, EPERM, EROFS):
        return error
    return OutputError(
        f"{error.filename or 'A file'} cannot be read or written.",
        error.strerror or "",
        "Name another file or folder, or free some space.",
    )


def _report(error: Exception, words: list[str]) -> int:
    """Write an error for people to stderr, for machines to stdout, and return its exit code."""
    from rig.errors import KNOWN_ERRORS, PAGE, ExitCode, anchor_of, exit_code_of
    from rig.output.console import emit_json

    if isinstance(error, TyperException):
        # a word on the command line that typer itself refused
        getattr(error, "show", lambda **_: None)(file=sys.stderr)
        if "extra argument" in str(error) and sum(Path(word).exists() for word in words) > 1:
            sys.stderr.write("fix: A command reads one path: name the folder of these files.\n")
        return int(ExitCode.USAGE)
    if "--debug" not in words and isinstance(error, OSError):
        error = _of_the_computer(error)
    if "--debug" in words or not isinstance(error, KNOWN_ERRORS):
        import traceback

        traceback.print_exception(error)
    code = exit_code_of(error)
    what = getattr(error, "what", None) or f"{type(error).__name__}: {error}"
    why, fix = getattr(error, "why", ""), getattr(error, "fix", "")
    extra = getattr(error, "extra", "")
    if extra:
        from rig.cli.extras import install_command, offer

        fix = f"Install the extra {extra!r}: {shlex.join(install_command(extra))}"
    lines = [f"error: {what}"]
    for word, text in (("why", why), ("fix", fix)):
        first, *more = text.splitlines() or [""]
        lines += [f"  {word}: {first}"] if first else []
        lines += [f"       {line}" for line in more]
    more = f"{PAGE}#{anchor_of(type(error))}"
    lines.append(f"  more: {more}")
    sys.stderr.write("\n".join(lines) + "\n")
    if "--json" in words:
        whole = {"what": what, "why": why, "fix": fix, "more": more, "exit_code": int(code)}
        with suppress(OSError):  # where stdout cannot be written, stderr has the error
            emit_json({"error": whole})
    if extra and "--json" not in words and offer(extra):
        sys.stderr.write("Installed. Type the command again.\n")
    return code


_interrupted = False
"""Whether Ctrl-C was pressed outside a session with a rig, which hears it in its own way."""


def _interrupt(number: int, frame: FrameType | None) -> None:
    global _interrupted
    _interrupted = True
    raise KeyboardInterrupt


def _is_of_interrupt(error: Exception) -> bool:
    """Whether an error is what a compiled library made of a Ctrl-C while it was loaded."""
    from rig.errors import KNOWN_ERRORS, MissingExtraError

    is_known = isinstance(error, KNOWN_ERRORS) and not isinstance(error, MissingExtraError)
    return _interrupted and not is_known


def run() -> None:
    """Run the command line and exit with its exit code."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _interrupt)
    if isinstance(sys.stdout, TextIOWrapper):  # as stderr does: a missing letter is not an error
        sys.stdout.reconfigure(errors="backslashreplace")
    sys.exit(main())
