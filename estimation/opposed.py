"""A channel whose sign contradicts the other channels of its equation."""

from collections.abc import Iterator

import numpy as np

from estimation.campaign import Campaign
from estimation.channels import unit_of
from estimation.errors import EstimationError
from estimation.fitting import fit
from estimation.model import Model, balance_channels, settled
from estimation.recording import shared_columns

UNEXPLAINED, FALLS = 0.5, 0.5
"""Residual with a wrong sign over the target, at least; with the right sign over that, at most."""

FIX = "Correct its sign, or that of the position: gain = -1 in the machine file."

MOTION = ("rad", "m", "rad/s", "m/s", "rad/s^2", "m/s^2")
"""Units of motion: the sign of a drive is stated instead of theirs."""


def opposed(fitted: Model, campaign: Campaign) -> str:
    """Return a sentence where a channel of a fitted equation has the opposite sign, else nothing.

    An actuator that is mounted or counted the other way gives a motion that gains energy from
    friction. Inertia and friction then stay at zero.
    """
    evidence = fitted.evidence
    at_zero = [
        term.effect.id
        for term in fitted.terms
        for p in term.effect.amplitudes
        if p.lower == 0.0 and term.values[p.name].value <= 0.0
    ]
    if (
        evidence is None
        or not at_zero
        or evidence.rmse < UNEXPLAINED * size_of_target(fitted, campaign)
    ):
        return ""
    errors = {}
    for channel in signed(fitted, campaign):
        try:
            turned = fit(fitted, negated(campaign, channel), bootstrap=0)
        except EstimationError:
            continue
        if turned.evidence is not None:
            errors[channel] = turned.evidence.rmse
    best = min(errors, key=lambda name: errors[name], default="")
    if not best or errors[best] > FALLS * evidence.rmse:
        return ""
    left = 100.0 * errors[best] / evidence.rmse
    return (
        f"{best} has the opposite sign of what the motion needs: with it negated, the residual is"
        f" {left:.2g} % of what it was. An effect larger than all declared terms can look the same."
    )


def signed(model: Model, campaign: Campaign) -> list[str]:
    """Return the recorded channels of an equation whose sign may be wrong: those of no motion."""
    recorded = shared_columns(list(campaign.evidence))
    names = dict.fromkeys((model.target, *model.channels))
    return [name for name in names if name in recorded and unit_of(name) not in MOTION]


def negated(campaign: Campaign, channel: str) -> Campaign:
    """Return the runs that count with a channel negated."""
    return Campaign.of(r.with_columns(**{channel: -r[channel]}) for r in campaign.evidence)


def driven_back(fitted: Model, campaign: Campaign) -> Iterator[str]:
    """Yield the drives with a negative gain that is more than the error of the fit, a sentence."""
    evidence = fitted.evidence
    for term in fitted.terms:
        if term.effect.id != "motor.torque_constant" or evidence is None:
            continue
        source, (gain,) = term.channels["source"], term.weights
        squares = [np.var(run[source]) for run in campaign.evidence if source in run]
        if gain < 0.0 and squares and abs(gain) * np.sqrt(np.mean(squares)) > evidence.rmse:
            yield (
                f"{source} has a negative gain: where it rises, it drives {fitted.target} down."
                f" Correct its sign, or that of {fitted.target} and the position: gain = -1 in the"
                " machine file."
            )


def size_of_target(model: Model, campaign: Campaign) -> float:
    """Return the root mean square of an equation's target, without means where a fit has none."""
    squares = []
    for recording in campaign.evidence:
        channels = balance_channels(model, recording)
        target = channels[model.target][settled(model, channels)]
        if target.size:
            centred = target - target.mean() if model.run_offsets else target
            squares.append(float(np.mean(centred**2)))
    return float(np.sqrt(np.mean(squares)))
