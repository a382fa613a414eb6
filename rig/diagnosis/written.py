"""The model that a diagnosis leaves, and what it loses when it runs live, with causal filters."""

from collections.abc import Iterable
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np

from estimation.campaign import Campaign
from estimation.derived import zero_phase_channels
from estimation.diagnosis.story import Story
from estimation.fitting import evidence_of
from estimation.model import Model, predict
from estimation.recording import Recording
from rig.diagnosis.run import Diagnosed


def with_cost_of_causal_filters(done: Diagnosed) -> Diagnosed:
    """Return the diagnosis with a note on what causal filters cost each balance's written model.

    Both estimates are held against the target as the zero-phase filter leaves it, on the confirm
    runs, over the samples that reported errors count, each run's mean removed.
    """
    notes = []
    runs = Campaign.of(done.recordings).timed()
    for name, story in done.stories.items():
        zero_phase, causal = confirm_errors(story.model, story, runs)
        scale, unit = (
            (1e3, "mN m") if story.balance.model.unit == "N m" else (1.0, story.model.unit)
        )
        notes.append(
            f"{name}: the written model leaves {scale * zero_phase:.3g} {unit} on the confirm runs"
            f" with zero-phase filters and {scale * causal:.3g} {unit} with the causal ones it runs"
            f" with live ({causal / max(zero_phase, 1e-300):.2f} times as much)."
        )
    diagnosis = replace(done.diagnosis, notes=(*done.diagnosis.notes, *notes))
    return replace(done, diagnosis=diagnosis)


def written_models(done: Diagnosed) -> list[Model]:
    """Return the models that a diagnosis leaves, each with its date and its errors.

    A watch then knows from the first run on what is usual, and a display how sure an estimate is.
    """
    now = datetime.now(UTC).isoformat(timespec="seconds")
    discover = Campaign.of([r for r in done.recordings if r.name in done.sealed.discover])
    return [
        replace(story.model, evidence=replace(evidence_of(story.model, discover), made_at=now))
        for story in done.stories.values()
    ]


def confirm_errors(
    model: Model, story: Story, recordings: Iterable[Recording]
) -> tuple[float, float]:
    """Return a model's root mean square errors on the confirm runs: zero-phase, then causal."""
    by_name = {recording.name: recording for recording in recordings}
    squares, samples = np.zeros(2), 0
    for run in story.confirm:
        recording = by_name[run.name]
        target = zero_phase_channels(recording, [model.target], model.low_pass)[model.target]
        both = np.array([target - predict(model, recording, causal) for causal in (False, True)])
        known = both[:, run.valid & np.isfinite(both).all(axis=0)]
        squares += np.sum((known - known.mean(axis=1, keepdims=True)) ** 2, axis=1)
        samples += known.shape[1]
    zero_phase, live = np.sqrt(squares / max(samples, 1))
    return float(zero_phase), float(live)
