"""`rig log info` of recordings of another format: a line a run."""

from pathlib import Path
from typing import Any

from rig.output.console import emit_json, results


def is_of_another_format(path: Path) -> bool:
    """Whether an importer other than that of the project's logs recognises a path."""
    from rig.importers.registry import importers

    known = importers()
    return (
        path.exists()
        and not known.pop("log").recognises(path)
        and any(one.recognises(path) for one in known.values())
    )


def show_runs(path: Path, json: bool) -> None:
    """Show each run's conditions, length, rate, flags and exclusion, and the channels."""
    from rig.cli.options import say_left_out
    from rig.importers.registry import open_campaign
    from rig.output.table import counted, listed

    campaign = open_campaign(path)
    say_left_out(path, campaign)
    runs: list[dict[str, Any]] = []
    channels: dict[str, None] = {}
    for recording in campaign:
        channels |= dict.fromkeys(recording.columns)
        runs.append(_described(recording))
    if json:
        emit_json({"runs": runs, "channels": list(channels)})
        return
    screen = results(json)
    screen.print(f"{counted(len(runs), 'run')}. Channels: {', '.join(channels)}.")
    width = max((len(run["name"]) for run in runs), default=0)
    for run in runs:
        flagged = f"; flagged samples: {run['flagged']}" if run["flagged"] else ""
        excluded = f"; does not count: {run['excluded']}" if run["excluded"] else ""
        screen.print(
            f"{run['name']:{width}}  {run['duration_s']:.3f} s, {run['rate_hz']:.4g} Hz"
            f"  {listed(run['conditions'])}{flagged}{excluded}"
        )


def _described(recording: Any) -> dict[str, Any]:
    return {
        "name": recording.name,
        "samples": len(recording),
        "duration_s": float(recording.time_s[-1] - recording.time_s[0]),
        "rate_hz": recording.sample_rate_hz,
        "conditions": dict(recording.conditions),
        "instrument": recording.instrument,
        "flagged": int((recording.flags != 0).sum()),
        "excluded": recording.excluded,
        "notes": recording.notes,
    }
