"""`rig model`: which model estimates for a rig, and the choice of another one."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from typer import Argument, Option

from estimation.channels import unit_of
from rig.cli.options import ConfigOption, SimFlag, complete_fitted, group
from rig.errors import UsageError
from rig.output.console import JsonFlag, present
from rig.output.provenance import now_utc

if TYPE_CHECKING:
    from rig.configuration.config import Config

model_app = group(
    "model",
    "Show and choose the model that estimates for a rig.",
    no_args_is_help=False,
    invoke_without_command=True,
)


@model_app.callback()
def show(
    context: typer.Context,
    config: ConfigOption = None,
    sim: SimFlag = False,
    json: JsonFlag = False,
) -> None:
    """Show the model in use for the rig, and those that `rig model use` takes by name."""
    if context.invoked_subcommand is not None:
        return
    from rig.configuration.chosen import choose_rig
    from rig.configuration.model_in_use import choices, model_in_use

    settings = choose_rig(config, sim)
    chosen = model_in_use(settings.name)
    past = [choice for choice in choices() if choice.rig == settings.name]
    how = f"chosen {past[-1].at[:16]} from {past[-1].source}" if chosen else "as configured"
    said = [f"{settings.name}: {_name(settings)} ({how})"]
    if settings.model_path is not None:
        said.append(f"  {_described(settings.model_path)}")
    known = fitted_models()
    said.append(f"By name: {', '.join(known)}. Any other by its file: rig model use FILE.")
    present(json, {"rig": settings.name, "model": settings.model_path, "known": known}, *said)


@model_app.command()
def use(
    model: Annotated[
        str,
        Argument(
            help="Fitted model: a file, or a name of `rig model`.", autocompletion=complete_fitted
        ),
    ],
    config: ConfigOption = None,
    sim: SimFlag = False,
    from_simulation: Annotated[
        bool, Option("--from-simulation", help="Allow a model of simulated recordings.")
    ] = False,
    json: JsonFlag = False,
) -> None:
    """Make a fitted model the one that `rig live`, `grip`, `replay` and `view` estimate with.

    It must read channels of the rig, and a real rig takes none that was fitted on simulated
    recordings. A copy is kept, so the file may change or go. `rig replay` and `rig view` take it
    for recordings of this rig. --model of a command goes before it.
    """
    from rig.configuration.chosen import choose_rig
    from rig.live.estimator import (
        channels_of,
        estimators_of,
        require_channels,
        require_measured,
    )

    settings = choose_rig(config, sim)
    file = Path(model)
    known = fitted_models()
    source = file if file.is_file() else known.get(model)
    if source is None:
        raise UsageError(
            f"There is no model {model!r}: neither a file nor a known name.",
            f"Known are: {', '.join(known)}.",
            "Write one with `rig fit LOGS --out FILE` or `rig diagnose LOGS --model-out FILE`.",
        )
    estimators = estimators_of(source, 1000.0)  # refuses what is not a fitted model
    require_channels(channels_of(estimators), settings, source)
    if not from_simulation:
        require_measured(estimators, settings, source)
    _choose(settings, source, [one.target_channel for one in estimators], json)


@model_app.command()
def reset(config: ConfigOption = None, sim: SimFlag = False, json: JsonFlag = False) -> None:
    """Go back to the model that the configuration names."""
    from rig.configuration.chosen import choose_rig

    _choose(choose_rig(config, sim), None, [], json)


def _choose(settings: "Config", source: Path | None, estimates: list[str], json: bool) -> None:
    """Choose, and print what is in use now and what it replaced."""
    from rig.configuration.model_in_use import choose

    replaced, was = settings.model_path, _name(settings)
    choose(settings.name, source, now_utc())
    now = settings.model_path
    said = [f"{settings.name}: {_name(settings)} in place of {was}."]
    if now is not None:
        said.append(f"  {_described(now)}")
    present(json, {"model": now, "replaced": replaced, "estimates": estimates}, *said)


def _described(path: Path) -> str:
    """Return the channels of a model and their intervals, in a sentence."""
    from rig.live.estimator import estimators_of

    parts = []
    for one in estimators_of(path, 1000.0):
        wide = one.usual_half_width
        width = f" +- {wide:.3g} {unit_of(one.target_channel)} (95 %)" if wide else ""
        parts.append(f"{one.target_channel}{width}")
    return f"It estimates {', '.join(parts)}."


def _name(settings: "Config") -> str:
    path = settings.model_path
    return "no model" if path is None else path.stem.removesuffix(".model")


def fitted_models() -> dict[str, Path]:
    """Return the shipped fitted models and the copies that were in use, by name."""
    from rig.configuration.config import SHIPPED
    from rig.configuration.model_in_use import choices

    ending = ".model.toml"
    shipped = {path.name.removesuffix(ending): path for path in SHIPPED.glob(f"*{ending}")}
    used = [choice.path for choice in choices()]
    kept = {path.stem: path for path in used if path is not None and path.is_file()}
    return dict(sorted(shipped.items())) | kept
