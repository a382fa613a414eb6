"""What the equation of a named effect leaves of its own cause.

An equation of the catalogue is one form of a cause, and the rig's own is a little another: a torque
constant that sags sooner, a ripple that grows with the load. What is left then depends on the
effect's own variables and on nothing else. It is no second cause, but a model that runs errs by it:
a compact formula of those variables stands beside the equation.
"""

from collections.abc import Sequence
from dataclasses import replace

from estimation.diagnosis.balance import Balance
from estimation.diagnosis.candidate import Candidate
from estimation.diagnosis.formula import formulas
from estimation.diagnosis.frozen import Part
from estimation.diagnosis.gates import Gates
from estimation.diagnosis.maps import best_map
from estimation.diagnosis.story import Claim
from estimation.diagnosis.variables import variables_of

WORTH = 0.1
"""Share of the squared error left that a formula must remove on runs left out."""


def formed(
    claims: Sequence[Claim],
    balance: Balance,
    offered: Sequence[Candidate],
    gates: Gates,
    seed: int,
) -> list[Claim]:
    """Return the claims, each named one in its family's best form.

    And with a formula of what its equation leaves, if any.

    Args:
        claims: Claims of a discovery.
        balance: The balance on the runs that discover, its channels as measured.
        offered: The catalogue's candidates.
        gates: What a formula must pass.
        seed: Seed of the surrogates.
    """
    bent = list(claims)
    for k, claim in enumerate(claims):
        named = claim.part.candidate
        if named is None or claim.named is None:
            continue
        others = [term for j, c in enumerate(bent) if j != k for term in c.part.terms]
        named = _best_of_family(balance, [*balance.terms, *others], named, offered)
        bent[k] = replace(claim, part=Part(named))
        known = [*balance.terms, *(term for c in bent for term in c.part.terms)]
        own = variables_of(named, balance)
        left = best_map(balance, known, gates.draws, seed, own)
        if left is None or left.p > gates.level or left.agree > gates.agree or left.gain < WORTH:
            continue
        found = formulas(balance, known, left)
        if found and found[0].gain >= WORTH:
            part = Part(named, formula=found[0].terms)
            bent[k] = replace(claim, part=part, form=found[0])
    return bent


def _best_of_family(
    balance: Balance, beside: Sequence[Candidate], named: Candidate, offered: Sequence[Candidate]
) -> Candidate:
    """Return an effect, or the same with more harmonics or another term where that is better.

    A grid of orders is too coarse to tell them apart before the order is known.
    """
    names = [p.name for p in named.effect.shape]
    alike = {
        c.id: replace(c, shape=named.shape)
        for c in offered
        if (c.family, c.channels) == (named.family, named.channels)
        and [p.name for p in c.effect.shape] == names
        and c.id != named.id
    }
    moved = [balance.refined([*beside, c], passes=2, last=1)[-1] for c in alike.values()]
    best = min(moved, key=lambda c: balance.loss([*beside, c]), default=named)
    clearly = balance.loss([*beside, best]) < (1 - WORTH) * balance.loss([*beside, named])
    return best if clearly else named
