"""One model fitted on every campaign, each result kept with its logs.

A campaign whose logs and model are those of a kept result is not fitted again, so a call that was
interrupted goes on where it stopped. Results are written as they come; when a process of the pool
is lost, only what it was working on is done again.
"""

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, Executor, as_completed
from contextlib import AbstractContextManager
from dataclasses import asdict, dataclass
from pathlib import Path

from estimation.errors import EstimationError
from estimation.files import write_text_atomic
from estimation.fitting import fit
from estimation.model_file import parse
from rig.campaigns.index import ENDINGS
from rig.errors import RigError
from rig.importers.registry import open_campaign

ATTEMPTS = 4
"""Pools that are started before a campaign that ends them is given up."""

Start = Callable[[], AbstractContextManager[Executor | None]]


@dataclass(frozen=True)
class Refit:
    """A model fitted on a campaign.

    Attributes:
        key: Digest of the logs' names, sizes and dates and of the model.
        values: Parameter, as `effect.parameter`, to its value in SI units.
        units: Parameter to its unit.
        rmse: Error of the fit, in the unit of the target; None where it failed.
        runs: Runs fitted.
        failed: Why it could not be fitted; empty otherwise.
    """

    key: str
    values: Mapping[str, float]
    units: Mapping[str, str]
    rmse: float | None
    runs: int
    failed: str = ""


def refit_all(
    folders: Sequence[Path],
    model: str,
    start: Start,
    on_done: Callable[[Path], None] = lambda _: None,
) -> dict[Path, Refit]:
    """Fit a model on each folder's campaign, or take the kept result.

    Args:
        folders: Folders of logs.
        model: The declared model, as TOML.
        start: Starts what the work is given to: processes, a cluster, or None for this process.
        on_done: Called with each folder that was fitted.

    Raises:
        BrokenExecutor: Processes end again and again.
        OSError: A result cannot be written.
    """
    keys = {folder: _key(folder, model) for folder in folders}
    found = {folder: kept for folder in folders if (kept := _kept(folder, model, keys[folder]))}
    for attempt in range(1, ATTEMPTS + 1):
        missing = [folder for folder in folders if folder not in found]
        if not missing:
            break
        try:
            with start() as executor:
                tasks = [(model, folder, keys[folder]) for folder in missing]
                for folder, found[folder] in _done(tasks, executor):
                    place = _place(folder, model)
                    place.parent.mkdir(exist_ok=True)
                    write_text_atomic(place, json.dumps(asdict(found[folder])) + "\n")
                    on_done(folder)
        except BrokenExecutor:
            if attempt == ATTEMPTS:
                raise
    return {folder: found[folder] for folder in folders}


def fit_folder(model: str, folder: Path, key: str) -> Refit:
    """Return a model fitted on a folder's campaign, or why it could not be."""
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


def _done(
    tasks: Sequence[tuple[str, Path, str]], executor: Executor | None
) -> Iterator[tuple[Path, Refit]]:
    if executor is None:
        yield from ((task[1], fit_folder(*task)) for task in tasks)
        return
    running = {executor.submit(fit_folder, *task): task[1] for task in tasks}
    for future in as_completed(running):
        yield running[future], future.result()


def _logs(folder: Path) -> list[Path]:
    return sorted(path for path in folder.iterdir() if path.name.endswith(ENDINGS))


def _key(folder: Path, model: str) -> str:
    digest = hashlib.sha256(model.encode())
    for path in _logs(folder):
        stat = path.stat()
        digest.update(f"{path.name} {stat.st_size} {stat.st_mtime_ns}\n".encode())
    return digest.hexdigest()


def _place(folder: Path, model: str) -> Path:
    return folder / "fit" / f"{hashlib.sha256(model.encode()).hexdigest()[:12]}.json"


def _kept(folder: Path, model: str, key: str) -> Refit | None:
    try:
        kept = Refit(**json.loads(_place(folder, model).read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError):
        return None
    return kept if kept.key == key else None
