"""Run a diagnosis on blind cases, hold it against the answers, and write the table.

python -m tests.blind --out build/blind --counts strong=40,weak=40

Resumes: what the state file holds is not run again. Recordings are deleted once a case is scored;
they can be made again from class, number and seed.
"""

import json
import shlex
import shutil
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer

from estimation.files import write_text_atomic
from rig.errors import UsageError
from rig.output.console import JsonFlag, emit_json, results
from rig.output.provenance import Provenance
from rig.output.table import to_markdown, to_rich
from tests.blind.generate import CLASSES, Answer, draw, write
from tests.blind.score import outcome, right
from tests.blind.summary import counted, tables
from tests.blind.truths import TRUTHS

COUNTS = "strong=40,weak=40,pair=30,outside=30,partial=10,confounded=20,control=100"
COMMAND = f"{sys.executable} -m rig diagnose {{case}} --json {{out}}"
TIME_LIMIT_S = 900.0
Result = Mapping[str, Any]


@dataclass(frozen=True)
class Places:
    """Where a study keeps its things.

    Attributes:
        root: Folder of the study.
    """

    root: Path

    @property
    def cases(self) -> Path:
        """Recordings, one folder a case; all that a diagnosis is shown."""
        return self.root / "cases"

    @property
    def answers(self) -> Path:
        """Answers; no command is told of this folder."""
        return self.root / "answers"

    @property
    def state(self) -> Path:
        """What has been scored so far."""
        return self.root / "state.json"


def counts_of(text: str) -> dict[str, int]:
    """Read `class=count,class=count`.

    Raises:
        UsageError: A class is unknown or a count is not a whole number.
    """
    counts = {}
    for word in text.split(","):
        kind, _, number = word.partition("=")
        if kind not in CLASSES or not number.isdigit():
            raise UsageError(
                f"{word!r} is no count of cases.",
                f"Classes are {', '.join(CLASSES)}.",
                "Write for example --counts strong=5,control=10.",
            )
        counts[kind] = int(number)
    return counts


def run_case(
    key: str, answer: Answer, places: Places, command: str, baselines: bool, runs: int | None
) -> Result:
    """Write, diagnose, score and delete one case."""
    folder = places.cases / answer.case
    shutil.rmtree(folder, ignore_errors=True)  # what an aborted study left
    write(answer, places.cases, places.answers, runs)
    found = places.root / f"{answer.case}.json"
    words = [
        w.replace("{case}", str(folder)).replace("{out}", str(found)) for w in shlex.split(command)
    ]
    start = time.perf_counter()
    diagnosis, said = _ask(words, found)
    seconds = time.perf_counter() - start
    result = outcome(answer, diagnosis)
    scored: dict[str, Any] = {
        "kind": answer.kind,
        "outcome": result,
        "right": right(answer, result),
        "seconds": seconds,
        "hidden": [effect.name for effect in answer.effects],
        "excitation": answer.excitation,
        "chain": answer.chain,
        "found": [
            (f["verdict"], f["balance"], f["family"], f["confidence"], f["also_in"])
            for f in (diagnosis or {}).get("findings", [])
        ],
        "message": "" if diagnosis is not None else said[-500:],
    }
    if diagnosis is not None:
        scored["ratio"] = _ratio(folder, answer, diagnosis)
    if baselines:
        scored["baselines"] = _baselines(folder, answer)
    shutil.rmtree(folder)
    found.unlink(missing_ok=True)
    return {key: scored}


def _ask(words: Sequence[str], found: Path) -> tuple[Mapping[str, Any] | None, str]:
    """Run the command; return its JSON, or None and what it said instead."""
    try:
        done = subprocess.run(
            words, capture_output=True, text=True, check=False, timeout=TIME_LIMIT_S
        )
    except subprocess.TimeoutExpired:
        return None, f"no answer within {TIME_LIMIT_S:g} s"
    text = found.read_text() if found.exists() else done.stdout
    try:
        return (json.loads(text) if done.returncode == 0 else None), done.stderr
    except json.JSONDecodeError as error:
        return None, f"the answer is not JSON: {error}"


def _ratio(folder: Path, answer: Answer, diagnosis: Mapping[str, Any]) -> float | None:
    """Return the confirm error over that of the true structure, the worst of the named balances.

    None where nothing that shows in its balance is named, or its channels do not tell the truth.
    """
    from rig.importers.registry import open_campaign
    from tests.blind.true_structure import told, true_rmse

    truths = [TRUTHS[effect.name] for effect in answer.effects]
    named = {
        finding["balance"]
        for finding in diagnosis["findings"]
        if finding["verdict"] == "identified"
        and any(t.names(finding["family"]) and finding["balance"] in t.balances for t in truths)
    }
    recordings = list(open_campaign(folder))
    discover = diagnosis["runs"]["discover"]
    ratios = [
        diagnosis["rmse_after"][balance] / true_rmse(answer, balance, recordings, discover)
        for balance in sorted(named)
        if told(answer, balance)
    ]
    return max(ratios, default=None)


def _baselines(folder: Path, answer: Answer) -> list[dict[str, Any]]:
    from rig.diagnosis.subject import declared_models
    from rig.importers.registry import open_campaign
    from tests.blind.baselines import run_all

    hidden = [effect.name for effect in answer.effects]
    return [
        {"method": one.method, "seconds": one.seconds} | counted(one.families, hidden)
        for one in run_all(declared_models(None, None), open_campaign(folder))
    ]


def blind(
    out: Annotated[Path, typer.Option(help="Folder of the study; resumed when it has a state.")],
    counts: Annotated[str, typer.Option(help="Cases of each class.")] = COUNTS,
    seed: Annotated[int, typer.Option(help="Seed of the draw.")] = 1,
    workers: Annotated[int, typer.Option(min=1, help="Cases at a time.")] = 1,
    command: Annotated[str, typer.Option(help="What diagnoses {case} and writes {out}.")] = COMMAND,
    report: Annotated[Path | None, typer.Option(help="Markdown file for the table.")] = None,
    baselines: Annotated[bool, typer.Option(help="Also run the textbook methods.")] = False,
    runs: Annotated[
        int | None, typer.Option(help="Only so many runs a case: a quick look.")
    ] = None,
    json_: JsonFlag = False,
) -> None:
    """Diagnose blind cases and count what comes out."""
    from rig.output.console import progress

    places = Places(out)
    wanted = counts_of(counts)
    setting = {"seed": seed, "command": command, "runs": runs}
    state = _resumed(places, setting)
    todo = {
        f"{kind}/{number}": draw(kind, number, seed)
        for kind, count in wanted.items()
        for number in range(count)
        if f"{kind}/{number}" not in state
    }
    with progress() as bar, ThreadPoolExecutor(workers) as pool:
        task = bar.add_task("blind cases", total=len(todo))
        futures = [
            pool.submit(run_case, key, answer, places, command, baselines, runs)
            for key, answer in todo.items()
        ]
        for future in as_completed(futures):
            state |= future.result()
            write_text_atomic(places.state, json.dumps({"setting": setting, "results": state}))
            bar.advance(task)
    found = tables(state)
    for table in found:
        results(json=json_).print(to_rich(table))
    if report is not None:
        head = f"# Blind study\n\n{Provenance.now(seed).line()}\n\n"
        write_text_atomic(report, head + "\n".join(map(to_markdown, found)))
    if json_:
        emit_json({"setting": setting, "results": state})


def _resumed(places: Places, setting: Mapping[str, Any]) -> dict[str, Any]:
    if not places.state.exists():
        return {}
    kept = json.loads(places.state.read_text())
    if kept["setting"] != setting:
        raise UsageError(
            f"{places.root} holds a study made in another way.",
            f"It was begun with {kept['setting']}.",
            "Name another folder with --out.",
        )
    results: dict[str, Any] = kept["results"]
    return results
