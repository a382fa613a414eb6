"""Twins for a diagnosis: which balances can be played by the simulated rig, and from what fits."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from estimation import model_file
from estimation.campaign import Campaign
from estimation.errors import EstimationError
from estimation.fitting import fit
from estimation.model import Model
from estimation.recording import Recording
from rig.errors import RigError
from rig.simulation.twin import Twin, build_twin

PLAYED = ("motor", "gearbox", "cable", "stretch")
"""Balances of the simulated rig's own parts."""

Maker = Callable[[Model, Sequence[Recording]], Callable[[int], Sequence[Recording]]]


REMEMBERED = 12
"""Campaigns of a twin kept for the next balance: as many as a decision takes at least."""


@dataclass(frozen=True)
class Remembered:
    """A twin that plays each of its first campaigns once, whichever balance asks.

    Attributes:
        twin: Plays the campaigns.
    """

    twin: Twin
    played: dict[int, Sequence[Recording]] = field(default_factory=dict, repr=False)

    def __call__(self, seed: int) -> Sequence[Recording]:
        """Return one campaign's recordings; the same seed gives the same samples."""
        if seed >= REMEMBERED:
            return self.twin(seed)
        if seed not in self.played:
            self.played[seed] = self.twin(seed)
        return self.played[seed]

    def __reduce__(self) -> tuple[type["Remembered"], tuple[Twin]]:
        """Leave what was played behind: another process plays it faster than it reads it."""
        return Remembered, (self.twin,)


@dataclass(frozen=True)
class Twins:
    """What simulates the declared models, or why nothing can.

    Attributes:
        twin: Plays a protocol and its own references; None where nothing can be recorded anew.
        makers: Balance to what `estimation.diagnosis.diagnose` asks for its twin.
        note: Why some balance has none, in words; empty when all have.
    """

    twin: Twin | None
    makers: Mapping[str, Maker] = field(default_factory=dict)
    note: str = ""


def twins_of(models: Sequence[Model], discover: Sequence[Recording]) -> Twins:
    """Fit every balance the simulated rig has and build one twin that plays them all.

    A balance that is not diagnosed is taken from the shipped models: the plant needs all its parts.

    Args:
        models: Declared models that are diagnosed.
        discover: Runs that discover; confirm runs have no part in a twin.
    """
    declared = {model.balance: model for model in model_file.reference_rig()}
    declared |= {model.balance: model for model in models}
    fitted, lost = [], []
    campaign = Campaign.of(discover)
    for balance in PLAYED:
        if balance not in declared:
            continue
        try:
            fitted.append(fit(declared[balance], campaign, bootstrap=0))
        except EstimationError:
            lost.append(balance)
    asked = [model.balance for model in models]
    played = tuple(b for b in asked if b in {model.balance for model in fitted})
    if not played:
        return Twins(None, note="The simulated rig plays none of these balances.")
    try:
        twin = build_twin(fitted, campaign)
    except (RigError, EstimationError) as error:
        return Twins(None, note=f"No simulated twin could be made. {error}")
    left = [balance for balance in asked if balance not in played]
    note = f"The simulated rig does not play {', '.join(left)}: no twins there." if left else ""
    remembered = Remembered(twin)
    return Twins(twin, dict.fromkeys(played, lambda *_: remembered), note)
