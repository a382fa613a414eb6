"""`rig export`: a fitted estimator as a C header."""

from pathlib import Path
from typing import Annotated

import typer

from rig.output.console import JsonFlag, present


def export(
    model: Annotated[
        Path, typer.Argument(help="Model or estimator of rig fit or rig adapt, .toml or .npz.")
    ],
    out: Annotated[Path, typer.Option("--out", "-o", help="File of the header, such as grip.h.")],
    equation: Annotated[
        str | None, typer.Option(help="Equation of a file of several models; the first if none.")
    ] = None,
    rate: Annotated[float, typer.Option(help="Call rate, Hz.")] = 1000.0,
    json: JsonFlag = False,
) -> None:
    """Write an estimator as a self-contained C header, for firmware.

    A model's file states its machine: units, ratios and derived channels follow from it.
    """
    from estimation import model_file
    from estimation.errors import nearest
    from estimation.estimator import load
    from estimation.estimators.bank import BankEstimator
    from estimation.estimators.c_header import header
    from estimation.estimators.model import ModelEstimator
    from estimation.estimators.network import NetworkEstimator
    from estimation.files import write_text_atomic
    from rig.errors import UsageError

    estimator = load(model)
    if equation is not None and model.suffix == ".toml":
        models = {one.balance: one for one in model_file.read_all(model)}
        if equation not in models:
            raise UsageError(
                f"{model} has no equation {equation!r}.", nearest(equation, list(models))
            )
        estimator = ModelEstimator(models[equation])
    if not isinstance(estimator, BankEstimator | NetworkEstimator | ModelEstimator):
        raise UsageError(
            f"{model} cannot be written as C.",
            "Models, state estimators and networks can.",
            "Fit one: rig fit PATH --out FILE.toml.",
        )
    write_text_atomic(out, header(estimator, out.stem.replace("-", "_").lower(), rate))
    present(json, {"header": out}, f"Header: {out}")
