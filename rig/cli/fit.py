"""`rig fit`: fit a declared model on a campaign."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rig.cli.left_out import SkipBad, say_left_out
from rig.cli.new_file import require_new
from rig.cli.options import FormatOption, MachineOption, SeedOption
from rig.cli.shipped import complete_model, complete_recordings, model_names
from rig.output.console import JsonFlag, emit_json, progress, results

if TYPE_CHECKING:
    from estimation.campaign import Campaign
    from estimation.cross_validation import HeldOutError
    from estimation.model import Model


STATE_NODES, THINNED = 12, 24
"""Hidden nodes of a network with physical states, and every how many-th sample it learns from."""


def fit_states(
    campaign: "Campaign",
    target: str,
    surrogate: str,
    live: bool,
    folds: int,
    seed: int,
    out: Path | None,
    json_: bool,
) -> None:
    """Fit products of physical states, and report the error on runs left out."""
    from estimation.bank.states import LOAD_SCALES, Bank
    from estimation.cross_validation import held_out_score
    from estimation.estimators.bank import BankRecipe
    from rig.errors import UsageError
    from rig.importers.jaw_steps import sentence, with_one_zero
    from rig.models.origins import with_origin

    if surrogate not in LOAD_SCALES:
        raise UsageError(
            f"{surrogate} does not stand for the load.",
            fix=f"Choose one of: {', '.join(LOAD_SCALES)}.",
        )
    recipe = BankRecipe(target, Bank(surrogate), causal=live)
    campaign, steps = with_one_zero(campaign, target)
    kept = campaign.evidence
    estimator = recipe.fit(campaign)
    error = held_out_score(recipe, kept, min(folds, len(kept)), seed) if len(kept) > 1 else None
    screen = results(json_)
    for line in sentence(steps):
        screen.print(line)
    if error is not None:
        screen.print(_held_out_line(target, len(kept), error.rmse))
    if out is not None:
        figures = {} if error is None else {"held_out_rmse": error.rmse, "held_out_p95": error.p95}
        with_origin(estimator, campaign, figures).save(out)
        screen.print(f"Estimator: {out}", markup=False)
    if json_:
        told = {"target": target, "surrogate": surrogate, "held_out": error, "jaw_steps": steps}
        emit_json(told | {"out": out})


def fit_network(
    campaign: "Campaign",
    target: str,
    surrogate: str,
    folds: int,
    seed: int,
    out: Path | None,
    json_: bool,
) -> None:
    """Train a network with physical states as inputs, and report the error on runs left out."""
    from estimation.cross_validation import closing_score
    from estimation.estimators.network import STATE_INPUTS, NetworkRecipe
    from estimation.networks.training import Settings
    from rig.importers.jaw_steps import sentence, with_one_zero
    from rig.models.origins import with_origin

    inputs = (*STATE_INPUTS, surrogate)
    recipe = NetworkRecipe(inputs, target, Settings(nodes=STATE_NODES, seed=seed), every=THINNED)
    campaign, steps = with_one_zero(campaign, target)
    kept = campaign.evidence
    folds = min(folds, len(kept))
    error = None
    with progress() as bar:
        task = bar.add_task("networks", total=1 + folds)
        estimator = recipe.fit(campaign)
        bar.advance(task)
        if len(kept) > 1:
            error = closing_score(recipe, kept, folds, seed, lambda: bar.advance(task))
    screen = results(json_)
    screen.print(f"{target} from {', '.join(inputs)}: {STATE_NODES} nodes.")
    for line in sentence(steps):
        screen.print(line)
    if error is not None:
        screen.print(_held_out_line(target, len(kept), error.rmse))
    if out is not None:
        figures = {} if error is None else {"held_out_rmse": error.rmse, "held_out_p95": error.p95}
        with_origin(estimator, campaign, figures).save(out)
        screen.print(f"Estimator: {out}", markup=False)
    if json_:
        told = {"target": target, "inputs": inputs, "nodes": STATE_NODES}
        emit_json(told | {"held_out": error, "jaw_steps": steps, "out": out})


def fit(
    path: Annotated[
        Path,
        typer.Argument(
            help="Recordings: a file, folder or archive.", autocompletion=complete_recordings
        ),
    ],
    model: Annotated[
        str | None,
        typer.Option(
            "--model",
            "-m",
            help=f"Declared model: a file, or one of {', '.join(model_names())}; `states` for"
            " products of physical states, `network` for a network with some of them as inputs. If"
            " none: grip, or with --machine all equations of the machine.",
            autocompletion=complete_model,
        ),
    ] = None,
    machine: MachineOption = None,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="File of the fitted model.")
    ] = None,
    folds: Annotated[int, typer.Option(help="Folds of the error on runs not fitted on.")] = 5,
    seed: SeedOption = 0,
    target: Annotated[
        str, typer.Option(help="Channel to estimate; with --model states or network.")
    ] = "proximal_torque_n_m",
    surrogate: Annotated[
        str, typer.Option(help="Channel that represents the load; with --model states or network.")
    ] = "motor_current_a",
    live: Annotated[
        bool, typer.Option("--live", help="Fit for use live; with --model states.")
    ] = False,
    skip_bad: SkipBad = False,
    format_: FormatOption = None,
    json_: JsonFlag = False,
) -> None:
    """Fit a declared model on all runs and report its error on runs it was not fitted on.

    `--model grasper` fits the force at each axis of a 3-DOF grasper, in one file.
    """
    from estimation import model_file
    from rig.machines.recordings import open_recordings
    from rig.output.table import to_rich
    from rig.reports.fit import held_out_sentence, parameter_table

    require_new(out)
    screen = results(json_)
    campaign = open_recordings(path, machine, format_, skip_bad)
    say_left_out(path, campaign)
    if model == "states":
        fit_states(campaign, target, surrogate, live, folds, seed, out, json_)
        return
    if model == "network":
        fit_network(campaign, target, surrogate, folds, seed, out, json_)
        return
    done = _fitted(declared_models(model, machine), campaign, folds, seed)
    for fitted, error in done:
        screen.print(to_rich(parameter_table(fitted)))
        one = "One run: there is no error on runs that it was not fitted on."
        screen.print(held_out_sentence(fitted, error) if error else one)
    if out is not None:
        model_file.write_all([fitted for fitted, _ in done], out)
        screen.print(f"Model: {out}", markup=False)
    if json_:
        told = [_told(fitted, error, out) for fitted, error in done]
        emit_json(told[0] if len(told) == 1 else {"models": told, "out": out})


def _fitted(
    models: "Sequence[Model]", campaign: "Campaign", folds: int, seed: int
) -> "list[tuple[Model, HeldOutError | None]]":
    """Return each model fitted, and its error on runs left out; none of a single run."""
    from estimation.cross_validation import held_out_error
    from estimation.fitting import fit as fit_model

    folds, several = min(folds, len(campaign.evidence)), len(campaign.evidence) > 1
    done = []
    with progress() as bar:
        task = bar.add_task("fits", total=2 * len(models))
        for declared in models:
            bar.update(task, description=declared.name)
            fitted = _dated(fit_model(declared, campaign, seed=seed))
            bar.advance(task)
            error = held_out_error(declared, campaign, folds=folds, seed=seed) if several else None
            done.append((fitted, error))
            bar.advance(task)
    return done


def declared_models(model: str | None, machine: Path | None) -> "list[Model]":
    """Return the models to fit: of a machine its equations, or the one of that name.

    Raises:
        ModelFileError: The model cannot be read.
        PlantFileError: The machine cannot be read.
    """
    from estimation.plant_models import declared
    from rig.live.estimator import models_in_use
    from rig.machines.shipped import read_machine

    if machine is None:
        return models_in_use(Path(model or "grip"))
    own = declared(read_machine(machine))
    named = [one for one in own if model in (None, one.balance)]
    return named or models_in_use(Path(str(model)))


def _dated(model: "Model") -> "Model":
    """Return a fitted model with the time of its fit."""
    from dataclasses import replace
    from datetime import UTC, datetime

    assert model.evidence is not None  # noqa: S101  a fit sets its evidence
    now = datetime.now(UTC).isoformat(timespec="seconds")
    return replace(model, evidence=replace(model.evidence, made_at=now))


def _told(model: "Model", error: "HeldOutError | None", out: Path | None) -> dict[str, Any]:
    """Return the JSON result of a fit."""
    parameters = [
        {"effect": term.effect.id, "parameter": p.name, "unit": term.unit(p, model.target)}
        | {"estimate": term.values[p.name]}
        for term in model.terms
        for p in term.parameters
    ]
    return {
        "model": model.name,
        "target": model.target,
        "unit": model.unit,
        "parameters": parameters,
        "evidence": model.evidence,
        "held_out": error,
        "out": out,
    }


def _held_out_line(target: str, runs: int, rmse: float) -> str:
    """Return the error of an estimator on runs that it was not fitted on, in words."""
    from estimation.channels import unit_of
    from rig.reports.diagnosis_words import display

    scale, unit = display(unit_of(target))
    return (
        f"{target}, closing samples of {runs} runs, each held out once:"
        f" RMSE {scale * rmse:.3g} {unit}."
    )
