"""The models with what a diagnosis found, and their errors live, with causal filters."""

from collections.abc import Iterable
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np

from estimation.causes.refit import Refit
from estimation.derived import zero_phase_channels
from estimation.model import Model, predict
from estimation.recording import Recording
from rig.diagnosis.run import Diagnosed


def with_cost_of_causal_filters(done: Diagnosed) -> Diagnosed:
    """Return the diagnosis with a note on the error of each written model with causal filters.

    Both estimates are compared with the target as the zero-phase filter gives it, on the test runs,
    over the samples that reported errors count, each run's mean removed.
    """
    notes = []
    for model in done.answer.models:
        refit = done.answer.refits.of[model.balance]
        zero_phase, causal = held_out_errors(model, refit, done.recordings)
        scale, unit = (1e3, "mN m") if model.unit == "N m" else (1.0, model.unit)
        notes.append(
            f"{model.balance}: the written model has an error of {scale * zero_phase:.3g} {unit} on"
            f" the test runs with zero-phase filters and {scale * causal:.3g} {unit} with the"
            f" causal ones it runs with live ({causal / max(zero_phase, 1e-300):.2f} times as"
            " much)."
        )
    diagnosis = replace(done.diagnosis, notes=(*done.diagnosis.notes, *notes))
    return replace(done, diagnosis=diagnosis)


def written_models(done: Diagnosed) -> list[Model]:
    """Return the models with the causes found, each with its date and its errors.

    A watch then has from the first run on the usual error, and a display the uncertainty of an
    estimate.
    """
    now = datetime.now(UTC).isoformat(timespec="seconds")
    return [
        replace(model, evidence=model.evidence and replace(model.evidence, made_at=now))
        for model in done.answer.models
    ]


def held_out_errors(
    model: Model, refit: Refit, recordings: Iterable[Recording]
) -> tuple[float, float]:
    """Return a model's root mean square errors on the test runs: zero-phase, then causal."""
    by_name = {recording.name: recording for recording in recordings}
    squares, samples = np.zeros(2), 0
    for name in refit.test_names:
        counted = refit.residuals(refit.solve([]), name)
        if counted is None:
            continue
        places, _ = counted
        recording = by_name[name]
        filtered = zero_phase_channels(recording, [model.target], model.low_pass, model.signals)
        target = filtered[model.target]
        both = np.array([target - predict(model, recording, causal) for causal in (False, True)])
        known = both[:, places][:, np.isfinite(both[:, places]).all(axis=0)]
        squares += np.sum((known - known.mean(axis=1, keepdims=True)) ** 2, axis=1)
        samples += known.shape[1]
    zero_phase, live = np.sqrt(squares / max(samples, 1))
    return float(zero_phase), float(live)
