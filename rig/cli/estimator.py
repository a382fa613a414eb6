"""`rig adapt | export | estimator`: make an estimator fit elsewhere, write it as C, compare two."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Option

from estimation.channels import unit_of
from estimation.errors import nearest
from estimation.files import write_text_atomic
from rig.cli import options
from rig.errors import UsageError
from rig.output.console import JsonFlag, counting, present, to_json
from rig.output.table import TextTable

if TYPE_CHECKING:
    from rig.models.adapt import Adaptation

LEAST_HZ = 1.0
"""Least rate of calls of an exported estimator."""

estimator_app = options.group("estimator", "Compare estimators.")


@estimator_app.callback()
def _estimator() -> None: ...


@estimator_app.command()
def compare(
    first: Annotated[Path, Argument(help="Estimator of rig fit or rig adapt.")],
    second: Annotated[Path, Argument(help="Another one of the same channel.")],
    on: Annotated[Path, Option("--on", help="Recordings: a file, folder or archive.")],
    format_: options.FormatOption = None,
    out: options.TablesFile = None,
    json: JsonFlag = False,
) -> None:
    """Compare two estimators on the same runs: which is better, and where."""
    from estimation.estimator import load
    from rig.importers.jaw_steps import sentence, with_one_zero
    from rig.importers.registry import open_campaign
    from rig.models.compared import compare as compared
    from rig.output.page import Page
    from rig.reports import compared as shown

    files, estimators = (first, second), (load(first), load(second))
    campaign, steps = with_one_zero(open_campaign(on, format_), estimators[0].target)
    with counting("runs", len(campaign)) as on_run:
        found = compared(files, estimators, campaign, on_run)
    lines, tables = [*shown.lines(found), *sentence(steps)], shown.tables(found)
    page = Page("Two estimators on the same runs", lines, tables, found.provenance)
    page.show(found, out, json)


def adapt(
    source: Annotated[Path, Argument(help="Estimator of the source, from rig fit.")],
    path: Annotated[Path, Argument(help="Recordings of the other instrument.")],
    runs: Annotated[
        str,
        Option(help="Names of runs to adapt with, as of rig log info, such as bench-01,bench-07."),
    ] = "",
    choose: Annotated[
        int, Option(min=1, help="Without --runs: how many, those nearest to all others.")
    ] = 1,
    out: Annotated[
        Path | None, Option("--out", "-o", help="File of the adapted estimator.")
    ] = None,
    scratch: Annotated[
        bool, Option(help="Also fit on the other instrument's runs alone, in folds.")
    ] = True,
    seed: options.SeedOption = 0,
    format_: options.FormatOption = None,
    json: JsonFlag = False,
    json_out: options.JsonFile = None,
) -> None:
    """Adapt an estimator with some runs and report its error on the runs not used."""
    from estimation.estimator import load
    from rig.importers.jaw_steps import sentence, with_one_zero
    from rig.importers.registry import open_campaign
    from rig.models.adapt import open_source, run_adaptation, runs_by_rule
    from rig.models.origins import with_origin

    options.require_new(out)
    estimator = open_source(load(source))
    campaign = open_campaign(path, format_)
    options.say_left_out(path, campaign)
    campaign, steps = with_one_zero(campaign, estimator.target)
    named = [name.strip() for name in runs.split(",") if name.strip()]
    with counting("runs", len(campaign)) as on_run:
        named = named or runs_by_rule(estimator, campaign, choose)
        result, new = run_adaptation(
            estimator,
            source,
            campaign,
            named,
            from_scratch=scratch,
            seed=seed,
            on_run=on_run,
        )
    said = [*sentence(steps), *(f"Check: {zero.sentence}" for zero in result.moved_zeros)]
    if out is not None:
        figures = {"unused_runs_rmse": result.adapted.rmse, "unused_runs_p95": result.adapted.p95}
        with_origin(new, campaign.select(result.used), figures, source).save(out)
        said.append(f"Estimator: {out}")
    if json_out is not None:
        write_text_atomic(json_out, to_json(result))
        said.append(f"Result: {json_out}")
    present(json, result, _errors(result), *said)


def _errors(result: "Adaptation") -> "TextTable":
    from rig.live.text import in_shown_unit

    scale, unit, _ = in_shown_unit(unit_of(result.target))
    named = {
        "as it is": result.as_it_is,
        f"adapted with {', '.join(result.used)}": result.adapted,
        "fitted on the other runs, in folds": result.scratch,
    }
    rows = [
        [name, *(f"{scale * value:.2f}" for value in (found.mae, found.p95, found.rmse))]
        for name, found in named.items()
        if found is not None
    ]
    note = f"Closing samples of {len(result.unused)} runs not used."
    if result.covered is not None:
        note += f" The adapted interval of 95 % covers {result.covered:.1%} of them."
    if result.left_out:
        note += f" Flagged, left out: {', '.join(result.left_out)}."
    columns = [f"{result.target}, {unit}", "MAE", "95th pct", "RMSE"]
    return TextTable(f"{result.source} on another instrument", columns, rows, note)


def export(
    model: Annotated[
        Path, Argument(help="Model or estimator of rig fit or rig adapt, .toml or .npz.")
    ],
    out: Annotated[Path, Option("--out", "-o", help="File of the header, such as grip.h.")],
    equation: Annotated[
        str | None, Option(help="Equation of a file of several models; the first if none.")
    ] = None,
    rate: Annotated[
        float | None,
        Option(help="Call rate, Hz; that of the fitted recordings, or 1000 where not known."),
    ] = None,
    json: JsonFlag = False,
) -> None:
    """Write an estimator as a self-contained C header, for firmware.

    A model's file states its machine: units, ratios and derived channels follow from it.
    """
    from estimation import model_file
    from estimation.estimator import load
    from estimation.estimators.bank import BankEstimator
    from estimation.estimators.c_header import USUAL_HZ, header
    from estimation.estimators.model import ModelEstimator
    from estimation.estimators.network import NetworkEstimator
    from rig.live.estimator import without_interval

    options.require_new(out)
    options.require_number("--rate", rate, LEAST_HZ)
    estimator = load(model)
    if equation is not None and model.suffix == ".toml":
        models = {one.balance: one for one in model_file.read_all(model)}
        if equation not in models:
            raise UsageError(
                f"{model} has no equation {equation!r}.", nearest(equation, list(models))
            )
        estimator = ModelEstimator(models[equation])
    elif equation is not None:
        raise UsageError(
            f"--equation {equation} cannot be used: {model} holds no equations.",
            fix="Omit --equation, or name a model file (.toml).",
        )
    if not isinstance(estimator, BankEstimator | NetworkEstimator | ModelEstimator):
        raise UsageError(
            f"{model} cannot be written as C.",
            "Models, state estimators and networks can.",
            "Fit one: rig fit PATH --out FILE.toml.",
        )
    own = estimator.model if isinstance(estimator, ModelEstimator) else None
    fitted = own and own.evidence
    if rate is None:
        rate = (fitted and fitted.sample_rate_hz) or USUAL_HZ
    write_text_atomic(out, header(estimator, out.stem.replace("-", "_").lower(), rate))
    said = f"Header: {out}, for {rate:g} calls a second"
    present(json, {"header": out, "rate_hz": rate}, said, *without_interval([own], model))
