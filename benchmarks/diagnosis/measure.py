"""Asking a version about every case, and scoring what it answered.

Answers are kept, one file a call: what is there is not asked again, and a change of the scoring
needs no new call. The rows, one JSON line a case, are made from the answers each time.
"""

import json
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.diagnosis.asking import Answer, Rig
from benchmarks.diagnosis.case import MACHINE_FILE, Case, Judgement, Report
from estimation import plant_file
from estimation.campaign import Campaign
from estimation.files import write_text_atomic
from estimation.fitting import fit
from estimation.model import Model, balance_channels, estimate, settled
from estimation.plant_models import declared
from estimation.recording import FloatArray
from rig.importers.registry import open_campaign


@dataclass(frozen=True)
class Row:
    """What one case came to.

    Attributes:
        right: Whether the answer was right; None where nobody knows.
        sure_and_wrong: Whether a wrong statement was made surely.
        extra: Wrong names in addition to the right ones.
        named: What was stated, finding by finding.
        ratio: Error on the test runs over the error of the declared model on the same campaign
            without the effects, the worst of the rightly named equations; None where not known.
        solved: Whether the answer was right after the proposed runs; None where none were played.
        cpu_s: Processor time of the first call.
        wall_s: Its time on the clock.
        note: What the answer came to, or why there was none.
    """

    case: str
    kind: str
    right: bool | None
    sure_and_wrong: bool
    extra: int
    named: list[str]
    ratio: float | None
    solved: bool | None
    cpu_s: float
    wall_s: float
    failed: bool
    note: str


def measure(
    cases: Iterable[Case],
    rig: Rig,
    folder: Path,
    *,
    ask: bool = True,
    on_row: Callable[[Row], None],
) -> list[Row]:
    """Return the rows of all cases, answered now or before, and write them to `rows.jsonl`.

    Args:
        cases: The cases, in the order in which they are asked.
        rig: The version to ask.
        folder: Where the answers of this version and generator are kept.
        ask: Whether to ask where an answer is missing; else such cases are left out.
        on_row: Called with each row as it is made.
    """
    rows = []
    for row in _rows(cases, rig, folder, ask):
        rows.append(row)
        lines = [json.dumps(asdict(one)) for one in rows]
        write_text_atomic(folder / "rows.jsonl", "\n".join(lines) + "\n")
        on_row(row)
    return rows


def _rows(cases: Iterable[Case], rig: Rig, folder: Path, ask: bool) -> Iterator[Row]:
    for case in cases:
        asking = _Asking(case, rig, folder, ask)
        first = asking.answer("", case.write)
        if first is not None:
            yield _row(case, first, asking)


@dataclass(frozen=True)
class _Asking:
    """One case and where its answers are kept."""

    case: Case
    rig: Rig
    folder: Path
    ask: bool

    def answer(self, which: str, write: Callable[[Path], None]) -> Answer | None:
        """Return the kept answer, or a new one; None where there is none and none is asked for."""
        kept = self.folder / f"{self.case.name}{which}.json"
        if kept.exists():
            return Answer.load(kept)
        if not self.ask:
            return None
        runs = Path(tempfile.mkdtemp(prefix="case-"))
        try:
            write(runs)
            options = [word.replace("{case}", str(runs)) for word in self.case.options]
            answer = self.rig.diagnose(runs, options)
        finally:
            shutil.rmtree(runs)
        answer.save(kept)
        return answer


def _row(case: Case, first: Answer, asking: _Asking) -> Row:
    report = first.report
    judged = Judgement(False, note=first.message) if report is None else case.judge(report)
    return Row(
        case.name,
        case.kind,
        judged.right,
        judged.sure_and_wrong,
        judged.extra,
        [] if report is None else [_stated(finding) for finding in report["findings"]],
        None if report is None else _ratio(report, judged, asking),
        _solved(first, asking),
        first.cpu_s,
        first.wall_s,
        report is None,
        judged.note,
    )


def _stated(finding: Report) -> str:
    """Return a finding in a few words: verdict, equation, families or variables, confidence."""
    names = [finding["family"], *finding["alternatives"]]
    if finding["verdict"] == "depends_on":
        names = finding["depends_on"]
    sure = "" if finding["confidence"] is None else f" ({finding['confidence']:.2f})"
    return f"{finding['verdict']} {finding['balance']}: {', '.join(names)}{sure}"


def _ratio(report: Report, judged: Judgement, asking: _Asking) -> float | None:
    """Return the error over that of the same campaign without the effects, or None."""
    case, without = asking.case, asking.case.write_without
    if not judged.right or not judged.equations or without is None:
        return None
    kept = asking.folder / f"{case.name}+without.json"
    if not kept.exists():
        if not asking.ask:
            return None
        errors = _errors_without(without, report, judged.equations)
        write_text_atomic(kept, json.dumps(errors))
    least = json.loads(kept.read_text())
    return float(max(report["rmse_after"][e] / least[e] for e in judged.equations))


def _solved(first: Answer, asking: _Asking) -> bool | None:
    """Return whether the proposed runs settle a confounded case; None where none are proposed."""
    case = asking.case
    if first.protocol is None or case.write_next is None or case.judge_next is None:
        return None
    write_next, text = case.write_next, first.protocol

    def write(folder: Path) -> None:
        case.write(folder)
        with tempfile.NamedTemporaryFile("w", suffix=".toml") as protocol:
            protocol.write(text)
            protocol.flush()
            write_next(Path(protocol.name), folder)

    answer = asking.answer("+next", write)
    if answer is None:
        return None
    return answer.report is not None and bool(case.judge_next(answer.report).right)


def _errors_without(
    write: Callable[[Path], None], report: Report, equations: Iterable[str]
) -> dict[str, float]:
    """Return the error of each equation without hidden effects, in the unit of its target.

    The declared model is fitted on the answer's training runs of the same campaign simulated
    without the effects, and its error is that of the answer's test runs: over all valid samples,
    filtered as the model says, each run's mean removed.
    """
    with tempfile.TemporaryDirectory(prefix="case-") as folder:
        write(Path(folder))
        recordings = list(open_campaign(Path(folder)))
        machine = Path(folder, MACHINE_FILE)
        own = plant_file.read(machine) if machine.exists() else None
        plant = own or plant_file.shipped_plant("reference")
    training, test = (
        Campaign.of([r for r in recordings if r.name in report["runs"][part]])
        for part in ("discover", "confirm")
    )
    models = {model.balance: model for model in declared(plant)}
    errors = {}
    for equation in equations:
        fitted = fit(models[equation], training, bootstrap=0)
        errors[equation] = _error(replace(fitted, counted="all"), test)
    return errors


def _error(model: Model, test: Campaign) -> float:
    """Return the root mean square residual over all valid samples, means removed."""
    parts = list[FloatArray]()
    for recording in test.evidence:
        run = balance_channels(model, recording)
        left = (run[model.target] - estimate(model, run))[settled(model, run)]
        parts.append(left - left.mean() if model.run_offsets else left)
    whole = np.concatenate(parts)
    return float(np.sqrt(np.mean((whole if model.run_offsets else whole - whole.mean()) ** 2)))
