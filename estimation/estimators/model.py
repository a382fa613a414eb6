"""Linear and physical estimators: an equation of effects."""

from dataclasses import dataclass
from pathlib import Path

from estimation.campaign import Campaign
from estimation.fitting import fit
from estimation.model import Model, predict
from estimation.model_file import write
from estimation.recording import FloatArray, Recording
from estimation.stream import Stream


@dataclass(frozen=True)
class ModelEstimator:
    """A fitted model as an estimator.

    Attributes:
        model: The fitted model.
    """

    model: Model

    @property
    def target(self) -> str:
        """Channel that is estimated."""
        return self.model.target

    def predict(self, recording: Recording, causal: bool = False) -> FloatArray:
        """Return the estimate for each sample; see `estimation.model.predict`."""
        return predict(self.model, recording, causal)

    def stepper(self, sample_rate_hz: float) -> Stream:
        """Return the model as it runs live."""
        return Stream(self.model, sample_rate_hz)

    def save(self, path: Path) -> None:
        """Write the model file."""
        write(self.model, path)


@dataclass(frozen=True)
class ModelRecipe:
    """Fits a declared model; the paper's straight line is the shipped model `linear`.

    Attributes:
        declared: The model without values.
    """

    declared: Model

    def fit(self, campaign: Campaign) -> ModelEstimator:
        """Fit on the runs that are not excluded; see `estimation.fitting.fit` for the errors."""
        return ModelEstimator(fit(self.declared, campaign, bootstrap=0))
