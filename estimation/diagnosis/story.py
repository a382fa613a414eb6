"""What is told of one balance: its claims, and all that a report needs."""

from collections.abc import Mapping
from dataclasses import dataclass

from estimation.diagnosis.balance import Balance, as_model
from estimation.diagnosis.candidate import UNKNOWN
from estimation.diagnosis.design import Run
from estimation.diagnosis.formula import Formula
from estimation.diagnosis.frozen import Frozen, Part
from estimation.diagnosis.naming import Discovery, Named
from estimation.model import Estimate, Model


@dataclass(frozen=True)
class Claim:
    """One finding before it is confirmed.

    Attributes:
        part: What it adds.
        verdict: What is claimed.
        named: The effect, or None.
        depends_on: Variables.
        formulas: What stands for its map in a model, the one that is written first.
        form: What stands beside a named effect for what its equation leaves of its own cause.
    """

    part: Part
    verdict: str
    named: Named | None
    depends_on: tuple[str, ...]
    formulas: tuple[Formula, ...] = ()
    form: Formula | None = None

    @property
    def family(self) -> str:
        """What it is called before anything is known of its name's certainty."""
        return self.named.candidate.family if self.named else UNKNOWN

    @property
    def written(self) -> Part:
        """What a model file holds of it: a formula in place of a map; nothing without one."""
        if self.part.map is None:
            return self.part
        return Part(formula=self.formulas[0].terms) if self.formulas else Part()


@dataclass(frozen=True)
class Story:
    """All that a report needs about one balance.

    Attributes:
        balance: The balance on the runs that discover.
        discovery: What the search did.
        claims: Claims that the confirm runs bore out.
        refused: Claims that were not kept, and why, in words.
        before: Declared model, frozen.
        after: Model with the claims, frozen.
        values: Parameters of `after`'s effects, in their order.
        written: What a model file holds: `after` with formulas in place of maps, frozen.
        written_values: Parameters of its effects, in their order.
        confirm: The confirm runs.
        candidates: Grid points tried.
        families: Families tried.
        unused: Runs without a usable sample in this balance.
        own_share: Least share of a force's declared column that the other declared ones do not say.
    """

    balance: Balance
    discovery: Discovery
    claims: tuple[Claim, ...]
    refused: tuple[str, ...]
    before: Frozen
    after: Frozen
    values: tuple[Mapping[str, Estimate], ...]
    written: Frozen
    written_values: tuple[Mapping[str, Estimate], ...]
    confirm: tuple[Run, ...]
    candidates: int
    families: tuple[str, ...]
    unused: tuple[str, ...] = ()
    own_share: float = 1.0

    @property
    def model(self) -> Model:
        """The fitted model with what was found: named effects, and formulas in place of maps."""
        return as_model(self.written.balance, self.written.terms, self.written_values)

    @property
    def declared_model(self) -> Model:
        """The declared model, fitted on the training runs."""
        weights = iter(self.before.weights.tolist())
        values = [
            {p.name: Estimate(next(weights)) for p in term.effect.amplitudes}
            | {p.name: Estimate(x) for p, x in zip(term.effect.shape, term.shape, strict=True)}
            for term in self.before.terms
        ]
        return as_model(self.before.balance, self.before.terms, values)
