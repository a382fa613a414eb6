"""The demonstration: record, fit, look at what is left, report.

The simulated rig holds one effect drawn by seed that the declared model knows nothing of. The
campaign goes the whole way: frames from the board, its driver, calibration, one log a run. What the
estimator is given are those logs and nothing else.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from estimation import model_file
from estimation.campaign import Campaign
from estimation.cross_validation import HeldOutError, held_out_error
from estimation.fitting import fit
from estimation.model import Model
from estimation.residual import Structure, largest_structure
from rig.config import Config, load_config
from rig.importers.registry import open_campaign
from rig.logger import open_logger
from rig.protocol import load_protocol
from rig.record import Progress, RunResult, open_campaign_folder, record_campaign
from rig.reports.first_look import first_look
from rig.reports.provenance import Provenance
from rig.reports.render import write_report
from rig.session import Session

PROTOCOL = "quick"
MODEL = "motor"
FOLDS = 4

Stage = Callable[[str], None]
"""Told what begins, in words."""


@dataclass(frozen=True)
class Demo:
    """What a demonstration came to.

    Attributes:
        folder: The campaign's logs.
        report: The HTML page.
        model: File of the fitted model.
        runs: What was recorded.
        held_out: Error of the declared model on runs it was not fitted on.
        structures: What its residual goes with, largest first.
        firmware: Whether the compiled firmware core was in the loop.
    """

    folder: Path
    report: Path
    model: Path
    runs: tuple[RunResult, ...]
    held_out: HeldOutError
    structures: tuple[Structure, ...]
    firmware: bool


def run_demo(folder: Path, seed: int, on_stage: Stage, on_progress: Progress) -> Demo:
    """Run the demonstration.

    Args:
        folder: Empty or absent folder for logs, model and report.
        seed: Seed of the hidden effect and of the noise.
        on_stage: Told what begins.
        on_progress: Told of the samples as they are recorded.
    """
    config = load_config().changed(simulation={"seed": seed, "draw_hidden": seed})
    on_stage("recording a short campaign through the board's frames and the driver")
    runs, firmware = _record(config, folder / "logs", on_progress)
    campaign = open_campaign(folder / "logs")
    on_stage(f"fitting the declared model {MODEL!r}")
    declared = model_file.read(Path(MODEL))
    fitted = fit(declared, campaign, seed=seed)
    held_out = held_out_error(declared, campaign, FOLDS, seed)
    model_path = folder / f"{MODEL}.model.toml"
    model_file.write(fitted, model_path)
    on_stage("looking at what the model leaves")
    structures = largest_structure(fitted, campaign, seed=seed)
    on_stage("writing the report")
    report = write_report(
        folder / "report.html", _page(fitted, campaign, structures, held_out, firmware, seed)
    )
    return Demo(folder, report, model_path, runs, held_out, tuple(structures), firmware)


def _record(
    config: Config, folder: Path, on_progress: Progress
) -> tuple[tuple[RunResult, ...], bool]:
    plans = open_campaign_folder(folder, load_protocol(PROTOCOL), config, resume=False)
    with Session(config, open_logger(config)) as session:
        runs = tuple(record_campaign(session, plans, folder, on_progress=on_progress))
    # known only once the simulation has been imported
    from rig.simulation.logger import uses_firmware

    return runs, uses_firmware(config.simulation)


def _page(
    fitted: Model,
    campaign: Campaign,
    structures: list[Structure],
    held_out: HeldOutError,
    firmware: bool,
    seed: int,
) -> str:
    board = "the compiled firmware core" if firmware else "the Python fake of the board"
    story = (
        f"The simulated rig, with one effect drawn by seed {seed} that no model was told of, was"
        f" recorded over {len(campaign)} runs through {board} and its driver. The declared model"
        f" {fitted.name!r} was fitted; on runs it was not fitted on it errs by"
        f" {held_out.rmse * 1e3:.2f} mN m rms ({held_out.folds} folds by run, run means removed)."
    )
    return first_look(fitted, campaign, structures, story, Provenance.now(seed))
