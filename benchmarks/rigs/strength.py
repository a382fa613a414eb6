"""How strong a hidden effect is, and the amplitude that makes it as strong as wanted.

Strength is the residual of the declared model with the effect over that without, in the
equation that shows it best.
"""

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from benchmarks.rigs import residual
from benchmarks.rigs.hidden import Hidden
from benchmarks.rigs.residual import EQUATIONS, Fitted, Prepared
from benchmarks.rigs.sensors import Fault
from benchmarks.rigs.stage import Stage, Switched, UnstableError

SHOWN = {
    "motor": ("motor",),
    "constant": ("motor",),
    "gear": ("gearbox",),
    "spindle": ("cable",),
    "cable": ("stretch",),
    "jaw": ("cable", "stretch"),
    "pulley": ("cable", "stretch"),
}
"""Place in the plant to the equations that an effect there adds to."""

READ = {
    "motor_current_a": ("motor",),
    "proximal_torque_n_m": ("motor", "gearbox", "cable"),
    "distal_torque_n_m": ("cable", "stretch"),
    "motor_angle_rad": ("motor", "gearbox"),
    "spindle_angle_rad": ("gearbox", "cable", "stretch"),
    "jaw_angle_rad": ("stretch",),
}
"""Reading to the equations that read it."""

TRIALS = 5
CLOSE = 0.08
"""A trial is good when its strength is so near to the wanted one, as a share of it."""

Fits = Mapping[str, Fitted]


def fits_of(runs: Sequence[Prepared], equations: Sequence[str] = EQUATIONS) -> Fits:
    """Fit declared equations on some runs."""
    return {equation: residual.fit(runs, equation) for equation in equations}


def shown(with_it: Fits, without: Fits, runs: Sequence[int]) -> tuple[float, str]:
    """Return the strength, and the equation that shows it best, over some of the fits' runs."""
    ratios = {e: with_it[e].rms(runs) / without[e].rms(runs) for e in with_it}
    best = max(ratios, key=lambda equation: ratios[equation])
    return ratios[best], best


def amplitude_for(
    stage: Stage, switched: Switched, wanted: float, runs: Sequence[int], most: float
) -> Switched | None:
    """Return the effect with the amplitude at which its strength on some runs is the wanted one.

    The first trial is where the effect's own power leads, worked out without noise. Each further
    one is where the squared excess leads, between the largest amplitude that was too weak and the
    smallest that was too strong.

    Args:
        stage: The rig.
        switched: The effect; its amplitude is a small one.
        wanted: Strength.
        runs: Places of the runs that are tried, some of which have the effect.
        most: Largest amplitude at which it is still a rig.

    Returns:
        None where no trial comes near.
    """
    equations = equations_of(switched.drawn.part)
    without = fits_of(stage.prepared(runs), equations)
    inside = [k for k, place in enumerate(runs) if place in switched.runs]
    try:
        own = _own_power(stage, switched, runs, without)
    except UnstableError:
        return None
    amplitude, low, high = switched.amplitude * np.sqrt((wanted**2 - 1.0) / own), 0.0, np.inf
    for _ in range(TRIALS):
        if amplitude > most:
            return None
        tried = replace(switched, amplitude=float(amplitude))
        strength = np.inf
        with contextlib.suppress(UnstableError):
            strength, _ = shown(fits_of(stage.prepared(runs, [tried]), equations), without, inside)
        if abs(strength / wanted - 1.0) < CLOSE:
            return tried
        low, high = (amplitude, high) if strength < wanted else (low, amplitude)
        excess = max(strength**2 - 1.0, 0.1)
        amplitude *= np.clip(np.sqrt((wanted**2 - 1.0) / excess), 0.3, 3.0)
        if not low < amplitude < high:
            amplitude = np.sqrt(max(low, 0.1 * high) * high) if np.isfinite(high) else 1.5 * low
    return None


def equations_of(part: Hidden | Fault) -> tuple[str, ...]:
    """Return the equations in which an effect may show best."""
    if isinstance(part, Hidden):
        return SHOWN[part.place]
    return READ[part.reading]


def _own_power(stage: Stage, switched: Switched, runs: Sequence[int], without: Fits) -> float:
    """Return the power of an effect in the equation that shows it best, over the residual's.

    Worked out without noise, so that it holds for an effect however small.
    """
    inside = [k for k, place in enumerate(runs) if place in switched.runs]
    fits = fits_of(stage.prepared(runs, [switched], silent=True), list(without))
    powers = [(fits[e].rms(inside) / without[e].rms(inside)) ** 2 for e in fits]
    return max(*powers, 1e-12)
