"""The residual monitor of a session: every finished run is compared with fitted models."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from estimation import model_file
from estimation.derived import CLOCKS, measured_channels
from estimation.model import NotFittedError
from estimation.watch import ResidualWatch, Sight
from rig.importers.registry import open_campaign


@dataclass
class RunWatch:
    """Watches the runs of a campaign as they are finished."""

    # each model's monitor, and the result of each run, in order
    watches: list[tuple[ResidualWatch, list[Sight]]]

    @property
    def channels(self) -> set[str]:
        """The measured channels that the models and their targets are computed from."""
        found = set[str]()
        for watch, _ in self.watches:
            model = watch.model
            names = {*model.channels, model.target} - {*CLOCKS}
            found |= {*measured_channels(names, model.signals)}
        return found

    def after(self, path: Path) -> str:
        """Read a finished run's log; return what is new to a person, empty when nothing is.

        Raises:
            DataError: The log cannot be read.
            MissingChannelError: The run lacks a channel of the model.
        """
        recordings, news = list(open_campaign(path).evidence), []
        for watch, sights in self.watches:
            fitted = _fits(sights)
            sights += [sight for run in recordings if (sight := watch.see(run)) is not None]
            if fitted and not _fits(sights):
                last = sights[-1]
                said = f"The model {watch.model.name!r} stops fitting, since run {last.since}"
                if last.usual is not None:
                    said += f" ({last.rmse / last.usual:.2f} times its own error)"
                news.append(f"{said}.")
        return " ".join(news)

    def to_json(self) -> list[dict[str, Any]]:
        """Return the state of each model in plain JSON types."""
        return [
            {
                "name": watch.model.name,
                "fits": _fits(sights),
                "since": sights[-1].since if sights else None,
                "runs": sights,
            }
            for watch, sights in self.watches
        ]


def _fits(sights: Sequence[Sight]) -> bool:
    return not sights or sights[-1].fits


def watch_runs(path: Path) -> RunWatch:
    """Begin to watch a model file.

    Raises:
        ModelFileError: The file cannot be read.
        NotFittedError: A parameter has no value.
    """
    models = model_file.read_all(path)
    for model in models:
        if not model.is_fitted:
            raise NotFittedError(
                f"The model {model.name!r} is not fitted.",
                "Only a fitted model can stop fitting.",
                f"Type `rig fit LOGS --model {path} --out FITTED.toml`.",
            )
    return RunWatch([(ResidualWatch(model), []) for model in models])
