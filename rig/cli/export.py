"""`rig export`: a fitted estimator as a C header."""

from pathlib import Path
from typing import Annotated

import typer

from rig.output.console import JsonFlag, emit_json, results


def export(
    model: Annotated[Path, typer.Argument(help="Estimator of rig fit or rig adapt, .npz.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="File of the header, such as grip.h.")],
    rate: Annotated[float, typer.Option(help="Call rate, Hz.")] = 1000.0,
    json: JsonFlag = False,
) -> None:
    """Write an estimator as a self-contained C header, for firmware."""
    from estimation.estimator import load
    from estimation.estimators.bank import BankEstimator
    from estimation.estimators.c_header import header
    from estimation.estimators.network import NetworkEstimator
    from estimation.files import write_text_atomic
    from rig.errors import UsageError

    estimator = load(model)
    if not isinstance(estimator, BankEstimator | NetworkEstimator):
        raise UsageError(
            f"{model} cannot be written as C.",
            "State estimators and networks can.",
            "Fit one: rig fit PATH --model states --out FILE.npz.",
        )
    write_text_atomic(out, header(estimator, out.stem.replace("-", "_").lower(), rate))
    results(json).print(f"Header: {out}", markup=False)
    if json:
        emit_json({"header": out})
