"""What an arm's joints share: the links' parameters, fitted on all joints together.

The links' torque is an additional channel, with the corrections that its fit determines least. The
direction of each joint is computed before the filter, since a filter and the sign function do not
commute. Wrist motors behind a coupling get channels of their own angles: their friction is a
function of those and acts on several joints.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from estimation.arm.balances import CORRECTIONS, ArmBalances
from estimation.arm.identification import fit, smoothed, thesis_weights
from estimation.arm.kinematics import ArmError
from estimation.arm.motion import FINE, LOW_PASS, joint_channels, motion_of
from estimation.filters import zero_phase
from estimation.recording import FloatArray, Recording

DAMPING = 1e-9
"""Damping of the shared fit: too small to bias identifiable parameters, enough for all others."""

EDGE_S = 0.5
"""Left out of the shared fit at either end of a run: the filter works on a reflection there."""


@dataclass(frozen=True)
class SharedFit:
    """Declared parameters that fit all joints together."""

    values: FloatArray  # shape (parameters,)
    # For each joint, the least determined corrections of the links' parameters, by their torque at
    # that joint: the directions that a missing effect may have biased. Shape (joints, parameters,
    # CORRECTIONS), one standard error each.
    corrections: FloatArray


def shared_fit(arm: ArmBalances, recordings: Sequence[Recording]) -> SharedFit:
    """Fit the declared parameters to all joints of the training runs; ArmError of short runs."""
    tables, torques = [], []
    for run in recordings:
        rate_hz = run.sample_rate_hz
        position, _, torque = joint_channels(run)
        edge, every = round(EDGE_S * rate_hz), round(rate_hz / (10 * LOW_PASS.cutoff_hz))
        inner = slice(edge, len(position) - edge, max(1, every))
        columns = arm.columns(motion_of(position, 1 / rate_hz, FINE))
        tables.append(smoothed(columns, rate_hz)[inner])
        torques.append(zero_phase(torque[:, : len(arm.joints)], rate_hz, LOW_PASS)[inner])
    table, aim = np.concatenate(tables), np.concatenate(torques)
    if len(aim) < 2 * table.shape[2]:
        raise ArmError(
            f"{len(aim)} samples are too few for the {table.shape[2]} parameters of {arm.name}.",
            "They are the samples of the training runs at the filter's rate.",
            "Record longer runs.",
        )
    found = fit(table, aim, thesis_weights(aim), DAMPING)
    values, vectors = np.linalg.eigh(found.covariance[np.ix_(arm.shared, arm.shared)])
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    corrections = np.zeros((len(arm.joints), table.shape[2], CORRECTIONS))
    for k in range(len(arm.joints)):
        felt = table[:, k, arm.shared] @ root
        _, _, directions = np.linalg.svd(felt, full_matrices=False)
        corrections[k, arm.shared] = root @ directions[:CORRECTIONS].T
    return SharedFit(found.values, corrections)


def laid_out(
    arm: ArmBalances, recordings: Sequence[Recording], train: Collection[str]
) -> list[Recording]:
    """Return an arm's runs with the shared links' torque, fitted on the training runs of them."""
    fitted = shared_fit(arm, [run for run in recordings if run.name in train])
    return [r.with_columns(**_added(arm, r, fitted)) for r in recordings]


def _added(arm: ArmBalances, recording: Recording, fitted: SharedFit) -> Mapping[str, FloatArray]:
    """Return each joint's links' torque and direction, and the motors' angles."""
    position, _, _ = joint_channels(recording)
    motion = motion_of(position, 1 / recording.sample_rate_hz, FINE)
    columns = arm.columns(motion)
    links = columns @ np.where(arm.shared, fitted.values, 0.0)
    direction = np.tanh(motion.velocity[:, : len(arm.joints)] / arm.sign_width)
    added: dict[str, FloatArray] = {}
    for k, names in enumerate(arm.joints):
        added |= {names.links: links[:, k], names.direction: direction[:, k]}
        for j, change in enumerate(fitted.corrections[k].T, start=1):
            added[names.links_correction(j)] = columns[:, k] @ change
    if arm.motors is not None:
        last = arm.wrist + len(arm.motors)
        angles = position[:, arm.wrist : last] @ arm.motors.T
        for names in arm.joints[arm.wrist :]:
            for k, angle in enumerate(angles.T, start=arm.wrist + 1):
                added[names.drive(k)] = angle
    return added
