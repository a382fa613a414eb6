"""What a discovery claims, and no more than that."""

from collections.abc import Sequence

from estimation.diagnosis.balance import Balance
from estimation.diagnosis.frozen import (
    Part,
)
from estimation.diagnosis.maps import LOAD, Map, channels_of
from estimation.diagnosis.search import Discovery, Gates, Named
from estimation.diagnosis.story import Claim

ANGLES = {"spindle_angle", "jaw_angle", "motor_angle"}
"""Angles of one rig move together."""


def claims_of(discovery: Discovery, balance: Balance, gates: Gates, may_name: bool) -> list[Claim]:
    """Return what is claimed, and no more than that."""
    claims: list[Claim] = []
    for named in discovery.named:
        if named.veto is not None:
            continue  # the map of what is left then speaks for it
        if may_name:
            sure = not named.rivals and named.confidence >= gates.sure
            verdict = "identified" if sure else "one_of"
            depends_on = _variables(named, balance)
            claims.append(Claim(Part(named.candidate), verdict, named, depends_on))
        else:
            claims.append(Claim(Part(named.candidate), "something_missing", named, ()))
    left = discovery.left_map
    told = {n.candidate.effect.any_function_of for n in discovery.named if n.veto is None}
    if (
        left is not None
        and left.p <= gates.level
        and left.variables not in told
        and not _told_already(left, claims)
    ):
        worth = left.gain * _share_left(claims, balance)
        # also what a named effect's form leaves of its own cause is no second cause
        if worth >= gates.map_floor and left.agree <= gates.agree:
            claims.append(_map_claim(left, may_name))
        elif worth >= gates.map_floor and not claims:
            claims.append(Claim(Part(map=left), "something_missing", None, ()))
    vetoes = [named.veto for named in discovery.named if named.veto is not None]
    if not claims and vetoes:
        # the effect is proved; that its name fell to this map makes it no smaller
        claims.append(_map_claim(vetoes[0], may_name))
    last = discovery.steps[-1] if discovery.steps else None
    if not claims and last is not None and last.stands_out(gates):
        claims.append(Claim(Part(last.candidates[0]), "something_missing", None, ()))
    return claims


def _told_already(found: Map, claims: Sequence[Claim]) -> bool:
    """Say whether a map has no variable but those of a named effect: what its form leaves."""
    said = {variable for claim in claims for variable in claim.depends_on}
    if said & ANGLES:
        said |= ANGLES
    return bool(claims) and set(found.variables) <= said


def _map_claim(found: Map, may_name: bool) -> Claim:
    if not may_name:
        return Claim(Part(map=found), "something_missing", None, ())
    return Claim(Part(map=found), "depends_on", None, found.variables)


def _share_left(claims: Sequence[Claim], balance: Balance) -> float:
    """Return the share of the declared model's squared error that the claims leave."""
    found = [c.part.candidate for c in claims if c.part.candidate is not None]
    return balance.loss([*balance.terms, *found]) / max(balance.loss(balance.terms), 1e-300)


def _variables(named: Named, balance: Balance) -> tuple[str, ...]:
    """Return the variables of an effect, from the channels it reads."""
    by_channel: dict[str, str] = {}
    for variable, channel in channels_of(balance.model.balance, balance.runs[0].channels).items():
        if variable != "history":
            by_channel[channel] = variable  # of two on one channel the last
    for _, channel in named.candidate.channels:
        if "_drive_" in channel:  # a motor behind the coupling of an arm's wrist
            by_channel[channel] = "motor_angle" if channel.endswith("_angle_rad") else "velocity"
    by_channel[LOAD] = "load"
    by_channel["distal_torque_n_m"] = "load"
    family = named.candidate.family
    found = [by_channel[c] for _, c in named.candidate.channels if c in by_channel]
    signs = family.startswith("friction.") and family.split(".")[1] not in ("viscous", "drag")
    found = ["velocity_sign" if signs and v == "velocity" else v for v in found]
    if family.startswith("hysteresis."):
        found.append("history")
    return tuple(dict.fromkeys(found))
