"""What a discovery claims, and no more than that."""

from collections.abc import Sequence

from estimation.diagnosis.balance import Balance
from estimation.diagnosis.frozen import Part
from estimation.diagnosis.gates import Gates
from estimation.diagnosis.maps import Map
from estimation.diagnosis.naming import Discovery
from estimation.diagnosis.story import Claim
from estimation.diagnosis.variables import variables_of, within


def claims_of(
    discovery: Discovery, balance: Balance, gates: Gates, may_name: bool, told: bool
) -> list[Claim]:
    """Return what is claimed, and no more than that.

    Args:
        discovery: What the search found.
        balance: The balance it searched.
        gates: What a claim must pass.
        may_name: Whether enough runs discover to name an effect.
        told: Whether the runs tell the declared gains, without which no name stands alone.
    """
    claims: list[Claim] = []
    for named in discovery.named:
        if named.veto is not None:
            continue  # the map of what is left then speaks for it
        if may_name:
            sure = told and not named.rivals and named.confidence >= gates.sure
            verdict = "identified" if sure else "one_of"
            of = variables_of(named.candidate, balance)
            claims.append(Claim(Part(named.candidate), verdict, named, of))
        else:
            claims.append(Claim(Part(named.candidate), "something_missing", named, ()))
    mapped = {n.candidate.effect.any_function_of for n in discovery.named if n.veto is None}
    left = discovery.left_map
    if left is not None and left.p <= gates.level and left.variables not in mapped:
        claims = _beside_map(claims, left, balance, gates, may_name)
    vetoes = [named.veto for named in discovery.named if named.veto is not None]
    if not claims and vetoes:
        # the effect is proved; that its name fell to this map makes it no smaller
        claims.append(_map_claim(vetoes[0], may_name))
    last = discovery.steps[-1] if discovery.steps else None
    if (
        not claims
        and last is not None
        and last.stands_out(gates)
        and last.worth >= gates.some
        and last.agree < gates.even
    ):
        claims.append(Claim(Part(last.candidates[0]), "something_missing", None, ()))
    return claims


def _beside_map(
    claims: list[Claim], left: Map, balance: Balance, gates: Gates, may_name: bool
) -> list[Claim]:
    """Return the claims with a map of what they leave, where it is worth a claim."""
    share = _share_left(claims, balance)
    worth = left.gain * share
    if worth < gates.map_floor:  # also what a named effect's form leaves of its own cause
        return claims
    if left.agree > gates.agree:
        return claims or [Claim(Part(map=left), "something_missing", None, ())]
    if not _told_already(left, claims):
        return [*claims, _map_claim(left, may_name)]
    if worth <= 1.0 - share:
        return claims
    # a name that removes less than a map of its own variables would, beside it, is not it
    others = [c for c in claims if not within(c.depends_on, left.variables)]
    return [*others, _map_claim(left, may_name)]


def _told_already(found: Map, claims: Sequence[Claim]) -> bool:
    """Say whether a map has no variable but those of a named effect: what its form leaves."""
    said = {variable for claim in claims for variable in claim.depends_on}
    return bool(claims) and within(found.variables, said)


def _map_claim(found: Map, may_name: bool) -> Claim:
    if not may_name:
        return Claim(Part(map=found), "something_missing", None, ())
    return Claim(Part(map=found), "depends_on", None, found.variables)


def _share_left(claims: Sequence[Claim], balance: Balance) -> float:
    """Return the share of the declared model's squared error that the claims leave."""
    found = [c.part.candidate for c in claims if c.part.candidate is not None]
    return balance.loss([*balance.terms, *found]) / max(balance.loss(balance.terms), 1e-300)
