"""One model fitted on every campaign, each result kept with its logs.

A campaign whose logs and model are those of a kept result is not fitted again, so a call that was
interrupted goes on where it stopped.
"""

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

from estimation.errors import EstimationError
from estimation.files import write_text_atomic
from estimation.fitting import fit
from estimation.model_file import parse
from rig.campaigns.index import ENDINGS
from rig.campaigns.work import Start, for_each
from rig.errors import RigError
from rig.importers.registry import open_campaign


@dataclass(frozen=True)
class Refit:
    """A model fitted on a campaign."""

    key: str  # digest of the logs' names, sizes and dates and of the model
    values: Mapping[str, float]  # parameter, as `effect.parameter`, to its value in SI units
    units: Mapping[str, str]
    rmse: float | None  # error of the fit, in the unit of the target; None where it failed
    runs: int
    failed: str = ""  # why it could not be fitted; empty otherwise


def refit_all(
    folders: Sequence[Path],
    model: str,
    start: Start,
    on_done: Callable[[Path], None] = lambda _: None,
) -> dict[Path, Refit]:
    """Fit a declared model, as TOML, on each folder's campaign, or take the kept result.

    `start` is that of `for_each`; `on_done` is called with each folder that was fitted.

    Raises:
        BrokenExecutor: Processes end again and again.
        OSError: A result cannot be written.
    """

    def keep(folder: Path, fitted: Refit) -> None:
        place = _place(folder, model)
        place.parent.mkdir(exist_ok=True)
        write_text_atomic(place, json.dumps(asdict(fitted)) + "\n")
        on_done(folder)

    kept = partial(_kept, model)
    return for_each(folders, kept, partial(fit_folder, model), start, keep)


def fit_folder(model: str, folder: Path) -> Refit:
    """Return a model fitted on a folder's campaign, or why it could not be."""
    key = _key(folder, model)
    try:
        fitted = fit(parse(model), open_campaign(folder, skip_bad=True), bootstrap=0)
    except (EstimationError, RigError) as error:
        return Refit(key, {}, {}, None, 0, str(error))
    values, units = {}, {}
    for term in fitted.terms:
        for parameter in term.parameters:
            name = f"{term.effect.id}.{parameter.name}"
            values[name] = term.values[parameter.name].value
            units[name] = term.unit(parameter, fitted.target)
    evidence = fitted.evidence
    assert evidence is not None  # noqa: S101  a fit states it
    return Refit(key, values, units, evidence.rmse, len(evidence.runs))


def _key(folder: Path, model: str) -> str:
    digest = hashlib.sha256(model.encode())
    for path in sorted(path for path in folder.iterdir() if path.name.endswith(ENDINGS)):
        stat = path.stat()
        digest.update(f"{path.name} {stat.st_size} {stat.st_mtime_ns}\n".encode())
    return digest.hexdigest()


def _place(folder: Path, model: str) -> Path:
    return folder / "fit" / f"{hashlib.sha256(model.encode()).hexdigest()[:12]}.json"


def _kept(model: str, folder: Path) -> Refit | None:
    try:
        kept = Refit(**json.loads(_place(folder, model).read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError):
        return None
    return kept if kept.key == _key(folder, model) else None
