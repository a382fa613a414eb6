"""What an effect must pass before it is claimed."""

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Gates:
    """What an effect must pass on the runs that discover.

    Attributes:
        chance: Largest p-value of the max statistic over the whole catalogue.
        floor: Least share of squared error removed on runs left out.
        agree: Largest p-value of the signed-rank test over the runs.
        most: Effects added to a balance at most.
        surrogates: Number of surrogates.
        rival: A rival has at least this share of the winner's gain.
        clearly: A rival of other variables is beaten by an effect that leaves less than this share
            of the error that the rival leaves, both in any form: less may be a matter of how well
            their regressors are known.
        clearly_alike: The same for a rival that does nearly the same on these runs.
        veto: A map withdraws a name when it leaves at most this share of the name's error.
        form: A map of no other variables than those of what was named does so only when the name
            removes less than this share of what the map removes: no formula has the true form.
        fair_form: Or, when the map leaves much of what the name leaves, less than this share.
        left_of_form: How much that is.
        map_floor: The floor of a map: with its many columns it bends to
            the noise of a sensor that the balance reads (a share of 0.04 to 0.12 on the simulated
            rig with nothing missing, three seeds, no twins).
        near: An effect that passes is taken before one that gains more and does not, when it has at
            least this share of that gain.
        together: A pair is taken in place of a first effect that passes when it leaves at most this
            share of what that effect and the best one after it leave, and removes more than these
            by the floor.
        some: Least share of squared error removed by what does not help in run after run, for it to
            be told as something missing.
        even: And the p-value over the runs at which it harms as many as it helps.
        kept: Least share of what an effect adds that is left when it is fitted through instruments:
            less, and it is made of the noise of a regressor.
        noise: Largest share of what an effect removes that may be the noise of a force's sensor.
        steady: Least mean over the runs of what time alone moves, over its spread from run to run:
            less, and it is the wander of a zero (8 to 28 for a drift of a third of a strong one,
            1.0 to 2.2 for zeros that wander, four campaigns of the simulated rig).
        told: Where less than this share of a force's reading is its own, beside what the other
            declared terms say too, the runs hardly tell the model's gain on it: no name is beaten
            there, and no map withdraws one.
        leftover: Least share that an effect has in what all found in a balance remove together:
            what a name's form leaves of its own cause is no second cause.
        most_left: Unless it removes at least this share of what the others leave: a form that is
            off leaves a little of many things (at most a third, 21 single effects).
        in_motion: What removes less than this share of the squared error in motion on the confirm
            runs must not add to that over all samples. At rest friction holds any torque, and what
            is clear in motion may be wrong there.
        mapped: A map must help in more than this share of the confirm runs.
        at_rest: A map that adds more than this share to the squared error over all samples is
            refused.
        parameters: Named parameters of the whole model at most, or None for no limit.
        akin: Whether an effect may be added beside one that looks alike: where a model must
            predict well rather than be named surely.
        sure: Least confidence of `identified`.
        balances: Balances that are searched: each is given its share of the chance.
    """

    chance: float = 0.02
    floor: float = 0.02
    agree: float = 0.05
    most: int = 4
    surrogates: int = 199
    rival: float = 0.5
    clearly: float = 0.97
    clearly_alike: float = 0.9
    veto: float = 0.9
    form: float = 0.9
    fair_form: float = 0.8
    left_of_form: float = 0.3
    sure: float = 0.9
    map_floor: float = 0.2
    near: float = 0.7
    together: float = 0.6
    some: float = 0.1
    even: float = 0.5
    kept: float = 0.5
    noise: float = 0.2
    steady: float = 3.0
    told: float = 0.01
    leftover: float = 0.15
    most_left: float = 0.4
    in_motion: float = 0.1
    mapped: float = 2 / 3
    at_rest: float = 0.5
    parameters: int | None = None
    akin: bool = False
    balances: int = 1

    @property
    def level(self) -> float:
        """Largest p-value on surrogates in one balance of several (Bonferroni)."""
        return self.chance / self.balances

    @property
    def draws(self) -> int:
        """Number of surrogates: as asked, and enough to reach the level."""
        return max(self.surrogates, math.ceil(1.0 / self.level) - 1)
