"""The demonstration: record, fit, diagnose, report.

The simulated rig contains one effect that the declared model lacks. The campaign uses the whole
chain: frames from the board, its driver, calibration, one log a run. What the diagnosis is
given are those logs and nothing else.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from estimation import model_file
from estimation.cross_validation import HeldOutError, held_out_error
from estimation.diagnosis.result import Diagnosis
from estimation.diagnosis.split import split
from estimation.files import write_text_atomic
from rig.bench.logger import open_logger
from rig.bench.session import Session
from rig.campaigns.index import DIAGNOSIS
from rig.configuration.config import Config, load_config
from rig.diagnosis.ledger import Ledger
from rig.diagnosis.run import run_diagnosis
from rig.diagnosis.traces import traces, written_models
from rig.importers.registry import open_campaign
from rig.output.provenance import Provenance
from rig.output.render import write_report
from rig.protocols.protocol import load_protocol
from rig.recording.campaign import Progress, RunResult, open_campaign_folder, record_campaign
from rig.reports import diagnosis as diagnosis_page
from rig.reports.fit import held_out_sentence

PROTOCOL = "diagnosis"
MODEL = "motor"
"""One equation keeps the demonstration short."""

DRAW = 212
"""Draws a ripple of the motor's torque; drawn, and not named, so that no log contains it.

A real fault of drives, and one that these runs can identify. Its amplitude varies over a turn,
unlike the catalogue's: drawn a quarter stronger, a smooth function fits better than the catalogue's
sine and the answer is that it depends on the motor's angle, which is right and makes a poorer show.
The rig around it is the one the declared models describe: the measured one also sticks at reversals
and rubs in proportion to its load, which hides a small effect.
"""

FOLDS = 4

Stage = Callable[[str], None]
"""Called with a message at the start and the result of each stage."""


@dataclass(frozen=True)
class Demo:
    """The results of a demonstration.

    Attributes:
        folder: Folder of all files, the logs in `logs`.
        report: The diagnosis, one HTML page.
        model: File of the model with the added effect.
        ledger: The demonstration's own log of uses of held-out data.
        runs: The recorded runs.
        held_out: Error of the declared model on runs it was not fitted on.
        diagnosis: What the model lacks.
        firmware: Whether the compiled firmware core was in the loop.
    """

    folder: Path
    report: Path
    model: Path
    ledger: Path
    runs: tuple[RunResult, ...]
    held_out: HeldOutError
    diagnosis: Diagnosis
    firmware: bool

    def to_json(self) -> dict[str, Any]:
        """Return everything, the diagnosis as its contract has it."""
        return {**vars(self), "diagnosis": self.diagnosis.to_json()}


def run_demo(folder: Path, seed: int, on_stage: Stage, on_progress: Progress) -> Demo:
    """Run the demonstration.

    Args:
        folder: Empty or absent folder for logs, model and reports.
        seed: Seed of the sensors' noise and of the split.
        on_stage: Told what begins or what was seen.
        on_progress: Told of the samples as they are recorded.
    """
    config = load_config().changed(
        simulation={"seed": seed, "draw_hidden": DRAW, "plant": "declared"}
    )
    logs = folder / "logs"
    on_stage("recording a campaign through the board's frames and the driver")
    runs, firmware = _record(config, logs, on_progress)
    declared = model_file.read(Path(MODEL))
    on_stage(f"fitting the declared model {MODEL!r} on the training runs")
    campaign = open_campaign(logs)
    # the others are the diagnosis' proof; whoever looks at them first proves nothing with them
    campaign = campaign.select(split(list(campaign.evidence), seed).discover)
    held_out = held_out_error(declared, campaign, FOLDS, seed)
    on_stage(held_out_sentence(declared, held_out))
    # simulated runs are not evidence about a real rig: they are not in the user's own log
    ledger = folder / "looks.jsonl"
    looks = Ledger(ledger)
    done, look = run_diagnosis(
        open_campaign(logs), [declared], looks, seed=seed, quick=True, on_stage=on_stage
    )
    model_path = folder / f"{MODEL}.model.toml"
    model_file.write_all(written_models(done), model_path)
    page = diagnosis_page.page(done.diagnosis, traces(done), Provenance.now(seed))
    kept = logs / DIAGNOSIS
    report = write_report(kept.with_suffix(".html"), page)
    write_text_atomic(kept, json.dumps(done.diagnosis.to_json(), indent=2) + "\n")
    looks.enter(look)
    return Demo(
        folder,
        report,
        model_path,
        ledger,
        runs,
        held_out,
        done.diagnosis,
        firmware,
    )


def _record(
    config: Config, folder: Path, on_progress: Progress
) -> tuple[tuple[RunResult, ...], bool]:
    plans = open_campaign_folder(folder, load_protocol(PROTOCOL), config, resume=False)
    with Session(config, open_logger(config)) as session:
        runs = tuple(record_campaign(session, plans, folder, on_progress=on_progress))
    # known only once the simulation has been imported
    from rig.simulation.logger import uses_firmware

    return runs, uses_firmware(config.simulation)
