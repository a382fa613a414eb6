"""What an adaptation brought, as a table."""

import numpy as np

from rig.models.adapt import Adaptation
from rig.output.table import TextTable


def table(result: Adaptation) -> TextTable:
    """Return the errors on the runs not used."""
    torque = result.target.endswith("_n_m")
    unit, scale = ("mN m", 1e3) if torque else ("deg", float(np.degrees(1.0)))
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
