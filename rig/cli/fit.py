"""`rig fit`: fit a declared model on a campaign."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Option

from estimation.channels import unit_of
from rig.cli import options
from rig.errors import UsageError
from rig.output.console import JsonFlag, counting, present, progress
from rig.output.provenance import now_utc
from rig.output.table import TextTable, counted

if TYPE_CHECKING:
    from estimation.campaign import Campaign
    from estimation.cross_validation import HeldOutError
    from estimation.estimators.bank import BankRecipe
    from estimation.estimators.network import NetworkRecipe
    from estimation.model import Model


FOLDS = 5
STATE_NODES, THINNED = 12, 24
"""Hidden nodes of a network with physical states, and every how many-th sample it learns from."""


def _recipe(
    kind: str, target: str, surrogate: str, live: bool, seed: int
) -> "BankRecipe | NetworkRecipe":
    """Return products of physical states, or a network with some of them as inputs."""
    from estimation.bank.states import LOAD_SCALES, Bank
    from estimation.estimators.bank import BankRecipe
    from estimation.estimators.network import STATE_INPUTS, NetworkRecipe
    from estimation.networks.training import Settings

    if kind == "network":
        settings = Settings(nodes=STATE_NODES, seed=seed)
        return NetworkRecipe((*STATE_INPUTS, surrogate), target, settings, every=THINNED)
    if surrogate not in LOAD_SCALES:
        raise UsageError(
            f"{surrogate} does not stand for the load.",
            fix=f"Choose one of: {', '.join(LOAD_SCALES)}.",
        )
    return BankRecipe(target, Bank(surrogate), causal=live)


def _learn(
    recipe: "BankRecipe | NetworkRecipe",
    campaign: "Campaign",
    folds: int,
    seed: int,
    out: Path | None,
    json_: bool,
) -> None:
    """Fit an estimator that is learnt, not declared, and report its error on runs left out."""
    from estimation.cross_validation import closing_score, held_out_score
    from estimation.estimators.network import NetworkRecipe
    from estimation.zeros import moved_zeros
    from rig.importers.jaw_steps import sentence, with_one_zero
    from rig.models.origins import with_origin
    from rig.reports.diagnosis_words import display, in_unit

    target = recipe.target
    campaign, steps = with_one_zero(campaign, target)
    kept, error = campaign.evidence, None
    folds = min(folds, len(kept))
    moved = moved_zeros(kept)
    said, figures = [*sentence(steps), *(f"Check: {zero.sentence}" for zero in moved)], {}
    with counting("fits", 1 + folds) as advance:
        estimator = recipe.fit(campaign)
        advance()
        if isinstance(recipe, NetworkRecipe):
            facts: dict[str, Any] = {"inputs": recipe.inputs, "nodes": STATE_NODES}
            said.insert(0, f"{target} from {', '.join(recipe.inputs)}: {STATE_NODES} nodes.")
            if len(kept) > 1:
                error = closing_score(recipe, kept, folds, seed, advance)
        else:
            facts = {"surrogate": recipe.bank.surrogate}
            error = held_out_score(recipe, kept, folds, seed) if len(kept) > 1 else None
    if error is not None:
        figures = {"held_out_rmse": error.rmse, "held_out_p95": error.p95}
        scale, unit = display(unit_of(target), error.rmse)
        said.append(
            f"{target}, closing samples of {len(kept)} runs, each held out once:"
            f" RMSE {in_unit(scale * error.rmse, unit)}."
        )
    if out is not None:
        with_origin(estimator, campaign, figures).save(out)
        said.append(f"Estimator: {out}")
    found = {"held_out": error, "jaw_steps": steps, "moved_zeros": moved, "out": out}
    present(json_, {"target": target, **facts, **found}, *said)


def fit(
    path: options.RecordingsArgument,
    model: Annotated[
        str | None,
        Option(
            "--model",
            "-m",
            help=f"Declared model: {options.DECLARED_MODEL}; `states` for"
            " products of physical states, `network` for a network with some of them as inputs. If"
            " none: grip, or with --machine all equations of the machine.",
            autocompletion=options.complete_model,
        ),
    ] = None,
    machine: options.MachineOption = None,
    balance: options.EquationOption = None,
    out: Annotated[Path | None, Option("--out", "-o", help="File of the fitted model.")] = None,
    folds: Annotated[
        int | None, Option(min=2, help="Folds of the error on runs not fitted on. If none: 5.")
    ] = None,
    seed: options.SeedOption = 0,
    target: Annotated[
        str, Option(help="Channel to estimate; with --model states or network.")
    ] = "proximal_torque_n_m",
    surrogate: Annotated[
        str, Option(help="Channel that represents the load; with --model states or network.")
    ] = "motor_current_a",
    live: Annotated[bool, Option("--live", help="Fit for use live; with --model states.")] = False,
    skip_bad: options.SkipBad = False,
    exclude: options.ExcludeOption = None,
    format_: options.FormatOption = None,
    json_: JsonFlag = False,
) -> None:
    """Fit a declared model on all runs and report its error on runs it was not fitted on.

    `--machine grasper` fits the force at each axis of a 3-DOF grasper, in one file.
    """
    options.require_machine(machine)

    from estimation import model_file
    from rig.importers.questions import doubts
    from rig.machines.recordings import open_recordings
    from rig.machines.shipped import of_equation, read_machine
    from rig.reports.fit import held_out_sentence, parameter_table

    options.require_new(out)
    campaign = options.without(path, open_recordings(path, machine, format_, skip_bad), exclude)
    folds = _folds(folds, len(campaign.evidence))
    if model in ("states", "network"):
        _learn(_recipe(model, target, surrogate, live, seed), campaign, folds, seed, out, json_)
        return
    campaign = campaign.held()  # it is walked many times
    declared = of_equation(declared_models(model, machine), balance)
    done = _fitted(declared, campaign, folds, seed)
    plant = None if machine is None else read_machine(machine)
    asked = doubts(list(campaign.evidence), plant)
    said: list[str | TextTable] = [f"Check: {line}" for line in asked]
    one = "One run: there is no error on runs that it was not fitted on."
    for fitted, error in done:
        said += [parameter_table(fitted), held_out_sentence(fitted, error) if error else one]
        said += _doubts(fitted, campaign)
    if out is not None:
        model_file.write_all([fitted for fitted, _ in done], out)
        said.append(f"Model: {out}")
    told = [_told(fitted, error, out) for fitted, error in done]
    present(json_, told[0] if len(told) == 1 else {"models": told, "out": out}, *said)


def _doubts(fitted: "Model", campaign: "Campaign") -> list[str]:
    """Return the doubts about a fit: its ratio, a sign, and amplitudes alike in these runs."""
    from estimation.opposed import FIX, driven_back, opposed
    from estimation.separable import inseparable
    from estimation.travel import off_ratio
    from estimation.turned import turned_runs

    if contradicted := off_ratio(fitted, list(campaign.evidence)):
        found = [f"{contradicted} The values above describe that: correct the ratio first."]
    elif contradicted := opposed(fitted, campaign):
        found = [f"{contradicted} {FIX}"]
    else:
        signs = (*driven_back(fitted, campaign), *turned_runs(fitted, campaign))
        found = [f"Check: {line}" for line in signs]
    if shared := inseparable(fitted, campaign):
        found.append(f"Check: {fitted.balance}: {shared}")
    return found


def _folds(asked: int | None, runs: int) -> int:
    """Return the number of folds, at most one a run."""
    if asked is not None and asked > runs:
        raise UsageError(
            f"--folds {asked} cannot be used: there are {counted(runs, 'run')}.",
            "A fold has at least one run.",
            f"Give at most {runs}." if runs > 1 else "Omit --folds.",
        )
    return min(asked or FOLDS, runs)


def _fitted(
    models: "Sequence[Model]", campaign: "Campaign", folds: int, seed: int
) -> "list[tuple[Model, HeldOutError | None]]":
    """Return each model fitted, and its error on runs left out; none of a single run."""
    from estimation.cross_validation import held_out_error
    from estimation.fitting import fit as fit_model

    several = len(campaign.evidence) > 1
    done = []
    with progress() as bar:
        task = bar.add_task("fits", total=2 * len(models))
        for declared in models:
            bar.update(task, description=declared.name)
            fitted = fit_model(declared, campaign, seed=seed)
            assert fitted.evidence is not None  # noqa: S101  a fit sets its evidence
            bar.advance(task)
            error = held_out_error(declared, campaign, folds=folds, seed=seed) if several else None
            half_width = error.half_width if error else None
            evidence = replace(fitted.evidence, made_at=now_utc(), half_width=half_width)
            done.append((replace(fitted, evidence=evidence), error))
            bar.advance(task)
    return done


def declared_models(model: str | None, machine: Path | None) -> "list[Model]":
    """Return the models to fit: of a machine its equations, or the one of that name."""
    from rig.live.estimator import models_in_use
    from rig.machines.shipped import equations_of

    if machine is None:
        return models_in_use(Path(model or "grip"))
    named = [one for one in equations_of(machine) if model in (None, one.balance)]
    return named or models_in_use(Path(str(model)))


def _told(model: "Model", error: "HeldOutError | None", out: Path | None) -> dict[str, Any]:
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
