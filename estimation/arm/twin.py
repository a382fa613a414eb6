"""The simulated null of an arm: its runs simulated from the declared model alone.

The positions are the measured ones; the torque is the declared model's on them, with friction that
changes sign as sharply as declared, so that filters affect simulated and measured torque alike.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from estimation.arm.balances import ArmBalances
from estimation.arm.motion import FINE, joint_channels, motion_of
from estimation.arm.shared import SharedFit, shared_fit, with_links
from estimation.filters import zero_phase
from estimation.recording import FloatArray, Recording


@dataclass(frozen=True)
class ArmTwin:
    """Seed to the training runs, with torque from the declared model.

    Attributes:
        runs: The runs, with the declared torque in the torque channels.
        noise: Standard deviation of each torque channel's white noise.
    """

    runs: tuple[Recording, ...]
    noise: dict[str, float]

    @classmethod
    def of(cls, arm: ArmBalances, runs: Sequence[Recording], fitted: SharedFit) -> "ArmTwin":
        """Make the simulated null of a fitted arm.

        Args:
            arm: The arm.
            runs: Training runs, with the links' torque.
            fitted: Declared parameters, from `estimation.arm.shared.shared_fit`.
        """
        made, loud = [], []
        for run in runs:
            position, _, torque = joint_channels(run)
            declared = (
                arm.columns(motion_of(position, 1 / run.sample_rate_hz, FINE)) @ fitted.values
            )
            own = {names.torque: declared[:, k] for k, names in enumerate(arm.joints)}
            made.append(replace(run, columns={**run.columns, **own}))
            loud.append(_noise(torque[:, : len(arm.joints)], run.sample_rate_hz))
        noise = np.sqrt(np.mean(np.square(loud), axis=0))
        return cls(
            tuple(made), {n.torque: float(x) for n, x in zip(arm.joints, noise, strict=True)}
        )

    def __call__(self, seed: int) -> list[Recording]:
        """Return the runs with noise of a seed."""
        random = np.random.default_rng(seed)
        return [
            run.with_columns(
                **{
                    name: run[name] + size * random.normal(size=len(run))
                    for name, size in self.noise.items()
                }
            )
            for run in self.runs
        ]


def laid_out(
    arm: ArmBalances, recordings: Sequence[Recording], discover: Collection[str]
) -> tuple[list[Recording], ArmTwin]:
    """Return an arm's runs with the shared link torque, fitted on training runs, and its null.

    Args:
        arm: The arm.
        recordings: Its runs.
        discover: Names of the training runs; others are not used in the fit.
    """
    fitted = shared_fit(arm, [run for run in recordings if run.name in discover])
    whole = with_links(arm, recordings, fitted)
    return whole, ArmTwin.of(arm, [run for run in whole if run.name in discover], fitted)


def _noise(torque: FloatArray, rate_hz: float) -> FloatArray:
    """Return white noise by what stands above the filter, shape (joints,)."""
    above = torque - zero_phase(torque, rate_hz, FINE)
    share = max(1 - 2 * FINE.cutoff_hz / rate_hz, 0.1)
    spread: FloatArray = above.std(axis=0) / np.sqrt(share)
    return spread
