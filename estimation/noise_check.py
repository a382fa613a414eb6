"""Channels of an equation that are mostly their readings' noise, and the cutoff that helps."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from estimation.campaign import Campaign
from estimation.derived import CLOCKS, measured_channels, origin_of, zero_phase_channels
from estimation.effects import Proportional
from estimation.model import Model, balance_channels, settled
from estimation.noise import MOST_ERROR, MOST_NOISE, noise_of, noisy_sentence, white_noise
from estimation.opposed import size_of_target
from estimation.recording import FloatArray

CUTOFFS = (1.5, 2.0, 3.0, 4.0, 6.0, 8.0)
"""The stated cutoff over those that are tried where a channel is mostly noise."""

LITTLE = 0.01
"""Noise of a derivative over the size of the target below which no cutoff is proposed."""


def noisy(model: Model, campaign: Campaign) -> Iterator[str]:
    """Yield the channels that are mostly noise of their readings, and the cutoff that helps."""
    for channel, share in _noise_shares(model, campaign).items():
        if share <= MOST_NOISE:
            continue

        def is_quiet(filtered: Model, channel: str = channel) -> bool:
            return _noise_shares(filtered, campaign)[channel] <= MOST_NOISE

        yield noisy_sentence(channel, share, _remedy(model, is_quiet))


def swamped(fitted: Model, campaign: Campaign) -> Iterator[str]:
    """Yield the derivatives whose noise is most of the error, and the cutoff that helps.

    It is enough where the noise of the target's own reading is the larger one, or where it is
    little of the target. A channel that is mostly noise has its sentence already.
    """
    evidence, shares = fitted.evidence, _noise_shares(fitted, campaign)
    little = LITTLE * size_of_target(fitted, campaign)

    def is_quiet(model: Model, channel: str) -> bool:
        noises = _noise_sizes(model, campaign)
        return noises[channel] <= max(noises[model.target], little)

    for channel, noise in _noise_sizes(fitted, campaign).items():
        is_small = evidence is None or noise <= MOST_ERROR * evidence.rmse
        if is_small or is_quiet(fitted, channel) or shares[channel] > MOST_NOISE:
            continue
        remedy = _remedy(fitted, partial(is_quiet, channel=channel))
        yield f"Most of the residual is {noise_of(channel, fitted.signals)}. {remedy}"


def _remedy(model: Model, is_enough: Callable[[Model], bool]) -> str:
    """Return the highest cutoff below the stated one with which a model has little noise."""
    stated_hz = model.low_pass.cutoff_hz
    tried = [float(f"{stated_hz / part:.2g}") for part in CUTOFFS]
    for cutoff_hz in tried:
        if is_enough(replace(model, low_pass=replace(model.low_pass, cutoff_hz=cutoff_hz))):
            return f"cutoff_hz = {cutoff_hz:g} under [machine] removes enough of it."
    return f"No cutoff_hz above {tried[-1]:g} removes enough: read it finer, or move faster."


def _noise_sizes(model: Model, campaign: Campaign) -> dict[str, float]:
    """Return the noise of the target, and of each derivative in the unit of the target."""
    gains = {model.target: 1.0}
    for term in model.terms:
        for channel in term.channels.values():
            if isinstance(term.effect, Proportional) and origin_of(channel)[1]:
                gains[channel] = gains.get(channel, 0.0) + float(term.weights[0])
    squares: dict[str, list[float]] = {name: [0.0] for name in gains}
    for _, noise in noises(model, campaign, list(gains)):
        for name, gain in gains.items():
            squares[name].append(float(np.var(gain * noise[name])))
    return {name: math.sqrt(np.mean(own[1:] or own)) for name, own in squares.items()}


def _noise_shares(model: Model, campaign: Campaign) -> dict[str, float]:
    """Return the noise of each channel over all that it holds, the median over runs."""
    names = [name for name in model.channels if name not in CLOCKS]
    shares: dict[str, list[float]] = {name: [] for name in names}
    for channels, noise in noises(model, campaign, names):
        for name in names:
            size = float(np.std(channels[name]))
            shares[name].append(float(np.std(noise[name])) / size if size else 0.0)
    return {name: float(np.median(found or [0.0])) for name, found in shares.items()}


def noises(
    model: Model, campaign: Campaign, names: Sequence[str]
) -> Iterator[tuple[dict[str, FloatArray], dict[str, FloatArray]]]:
    """Yield of each run channels, and the noise of their readings, where the equation counts."""
    measured = measured_channels(names, model.signals)
    for run in campaign.evidence:
        channels = balance_channels(model, run)
        places = settled(model, channels)
        noise = zero_phase_channels(
            white_noise(run, measured, model.signals), names, model.low_pass, model.signals
        )
        if places.size:
            own, white = ({n: x[n][places] for n in names} for x in (channels, noise))
            yield own, white
