"""`rig adapt`: make an estimator of one instrument fit another one."""

from pathlib import Path
from typing import Annotated

import typer

from rig.cli.options import FormatOption, JsonFile, SeedOption, require_new, say_left_out
from rig.output.console import JsonFlag, present, progress, to_json


def adapt(
    source: Annotated[Path, typer.Argument(help="Estimator of the source, from rig fit.")],
    path: Annotated[Path, typer.Argument(help="Recordings of the other instrument.")],
    runs: Annotated[str, typer.Option(help="Runs to adapt with, such as 00,11.")] = "",
    choose: Annotated[
        int, typer.Option(min=1, help="Without --runs: how many, those nearest to all others.")
    ] = 1,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="File of the adapted estimator.")
    ] = None,
    scratch: Annotated[
        bool, typer.Option(help="Also fit on the other instrument's runs alone, in folds.")
    ] = True,
    seed: SeedOption = 0,
    format_: FormatOption = None,
    json: JsonFlag = False,
    json_out: JsonFile = None,
) -> None:
    """Adapt an estimator with some runs and report its error on the runs not used."""
    from estimation.estimator import load
    from estimation.files import write_text_atomic
    from rig.importers.jaw_steps import sentence, with_one_zero
    from rig.importers.registry import open_campaign
    from rig.models.adapt import open_source, run_adaptation, runs_by_rule
    from rig.models.origins import with_origin
    from rig.reports.adapt import table

    require_new(out)
    estimator = open_source(load(source))
    campaign = open_campaign(path, format_)
    say_left_out(path, campaign)
    campaign, steps = with_one_zero(campaign, estimator.target)
    named = [name.strip() for name in runs.split(",") if name.strip()]
    with progress() as bar:
        task = bar.add_task("runs", total=len(campaign))
        named = named or runs_by_rule(estimator, campaign, choose)
        result, new = run_adaptation(
            estimator,
            source,
            campaign,
            named,
            from_scratch=scratch,
            seed=seed,
            on_run=lambda run: bar.advance(task),
        )
    said = [*sentence(steps)]
    if out is not None:
        figures = {"unused_runs_rmse": result.adapted.rmse, "unused_runs_p95": result.adapted.p95}
        with_origin(new, campaign.select(result.used), figures, source).save(out)
        said.append(f"Estimator: {out}")
    if json_out is not None:
        write_text_atomic(json_out, to_json(result))
        said.append(f"Result: {json_out}")
    present(json, result, table(result), *said)
