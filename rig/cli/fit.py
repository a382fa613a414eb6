"""`rig fit`: fit a declared model on a campaign."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rig.cli.output import JsonFlag, emit_json, results

if TYPE_CHECKING:
    from estimation.campaign import Campaign


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
    from estimation.estimators.bank import BankRecipe, held_out_score
    from rig.errors import UsageError

    if surrogate not in LOAD_SCALES:
        raise UsageError(
            f"{surrogate} does not stand for the load.",
            fix=f"Choose one of: {', '.join(LOAD_SCALES)}.",
        )
    recipe = BankRecipe(target, Bank(surrogate), causal=live)
    kept = campaign.evidence
    estimator = recipe.fit(campaign)
    error = held_out_score(recipe, kept, min(folds, len(kept)), seed) if len(kept) > 1 else None
    screen = results(json_)
    if error is not None:
        screen.print(
            f"{target}, closing samples of {len(kept)} runs, each held out once:"
            f" rmse {error.rmse:.4g}."
        )
    if out is not None:
        estimator.save(out)
        screen.print(f"Estimator: {out}", markup=False)
    if json_:
        emit_json({"target": target, "surrogate": surrogate, "held_out": error, "out": out})


def fit_network(
    campaign: "Campaign", target: str, surrogate: str, seed: int, out: Path | None, json_: bool
) -> None:
    """Train a network with physical states as inputs."""
    from estimation.estimators.network import STATE_INPUTS, NetworkRecipe
    from estimation.networks.training import Settings

    inputs = (*STATE_INPUTS, surrogate)
    recipe = NetworkRecipe(inputs, target, Settings(nodes=STATE_NODES, seed=seed), every=THINNED)
    estimator = recipe.fit(campaign)
    screen = results(json_)
    screen.print(f"{target} from {', '.join(inputs)}: {STATE_NODES} nodes.")
    if out is not None:
        estimator.save(out)
        screen.print(f"Estimator: {out}", markup=False)
    if json_:
        emit_json({"target": target, "inputs": inputs, "nodes": STATE_NODES, "out": out})


def fit(
    path: Annotated[Path, typer.Argument(help="Recordings: a file, folder or archive.")],
    model: Annotated[
        str,
        typer.Option(
            "--model",
            "-m",
            help="Declared model: a file, a shipped one by name, `states` for products of"
            " physical states, or `network` for a network with some of them as inputs.",
        ),
    ] = "grip",
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Where the fitted model goes.")
    ] = None,
    folds: Annotated[int, typer.Option(help="Folds of the error on runs not fitted on.")] = 5,
    seed: Annotated[int, typer.Option(help="Seed of folds and bootstrap.")] = 0,
    target: Annotated[
        str, typer.Option(help="Channel to estimate; with --model states or network.")
    ] = "proximal_torque_n_m",
    surrogate: Annotated[
        str, typer.Option(help="Channel that stands for the load; with --model states or network.")
    ] = "motor_current_a",
    live: Annotated[
        bool, typer.Option("--live", help="Fit for use live; with --model states.")
    ] = False,
    format_: Annotated[
        str | None, typer.Option("--format", help="Format of the recordings; guessed if none.")
    ] = None,
    json_: JsonFlag = False,
) -> None:
    """Fit a declared model on all runs and report its error on runs it was not fitted on."""
    from estimation import model_file
    from estimation.cross_validation import held_out_error
    from estimation.fitting import fit as fit_model
    from rig.importers.registry import open_campaign
    from rig.reports.first_look import parameter_table
    from rig.reports.table import to_rich

    screen = results(json_)
    campaign = open_campaign(path, format_)
    if model == "states":
        fit_states(campaign, target, surrogate, live, folds, seed, out, json_)
        return
    if model == "network":
        fit_network(campaign, target, surrogate, seed, out, json_)
        return
    declared = model_file.read(Path(model))
    fitted = fit_model(declared, campaign, seed=seed)
    error = held_out_error(declared, campaign, folds=min(folds, len(campaign.evidence)), seed=seed)
    screen.print(to_rich(parameter_table(fitted)))
    screen.print(
        f"{fitted.target} on {error.runs} runs not fitted on: rmse {error.rmse:.4g} {fitted.unit},"
        f" {error.rmse_with_means:.4g} with each run's mean left in."
    )
    if out is not None:
        model_file.write(fitted, out)
        screen.print(f"Model: {out}", markup=False)
    if json_:
        parameters = [
            {"effect": term.effect.id, "parameter": p.name, "unit": term.unit(p, fitted.target)}
            | {"estimate": term.values[p.name]}
            for term in fitted.terms
            for p in term.parameters
        ]
        emit_json(
            {
                "model": fitted.name,
                "target": fitted.target,
                "unit": fitted.unit,
                "parameters": parameters,
                "evidence": fitted.evidence,
                "held_out": error,
                "out": out,
            }
        )
