"""The residual watch of a recording session: every finished run is held against a fitted model."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from estimation import model_file
from estimation.model import NotFittedError
from estimation.watch import ResidualWatch, Sight
from rig.importers.registry import open_campaign


@dataclass
class RunWatch:
    """Watches the runs of a campaign as they are finished.

    Attributes:
        watch: The watch of the model.
        sights: What each run said, in order.
    """

    watch: ResidualWatch
    sights: list[Sight] = field(default_factory=list)

    def after(self, path: Path) -> str:
        """Read a finished run's log; return what is new to a person, empty when nothing is.

        Raises:
            DataError: The log cannot be read.
            MissingChannelError: The run lacks a channel of the model.
        """
        fitted = self.fits
        for recording in open_campaign(path).evidence:
            sight = self.watch.see(recording)
            if sight is not None:
                self.sights.append(sight)
        if not fitted or self.fits:
            return ""
        last = self.sights[-1]
        usual = "" if last.usual is None else f" ({last.rmse / last.usual:.2f} times its own error)"
        return f"The model {self.watch.model.name!r} stops fitting, since run {last.since}{usual}."

    @property
    def fits(self) -> bool:
        """Whether the model fits so far."""
        return not self.sights or self.sights[-1].fits

    def to_json(self) -> dict[str, Any]:
        """Return the state in plain JSON types."""
        return {
            "name": self.watch.model.name,
            "fits": self.fits,
            "since": self.sights[-1].since if self.sights else None,
            "runs": self.sights,
        }


def watch_runs(path: Path) -> RunWatch:
    """Begin to watch a model file.

    Raises:
        ModelFileError: The file cannot be read.
        NotFittedError: A parameter has no value.
    """
    model = model_file.read(path)
    if not model.is_fitted:
        raise NotFittedError(
            f"The model {model.name!r} is not fitted.",
            "Only a fitted model can stop fitting.",
            f"Type `rig fit LOGS --model {path} --out FITTED.toml`.",
        )
    return RunWatch(ResidualWatch(model))
