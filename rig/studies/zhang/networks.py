"""The networks of Zhang et al. 2022: torque in free space from states, one network a joint.

Joints 1 and 2 take the states of the six joints, the others the gripper's too; each state with
those before it in a short window, as in the authors' earlier work. Where the gripper never moved,
its states contain no information and are omitted. The paper states neither window nor size; these
networks are small and trained by Levenberg-Marquardt, which takes a second each.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from estimation.networks.network import Network
from estimation.networks.training import Settings, train
from estimation.recording import FloatArray
from rig.studies.zhang.psm import GRIPPER, PsmRun

WINDOW = (0, 5, 10)
"""Samples back of the states in the window: 0, 0.1 and 0.2 s."""

GRIPPER_FROM = 2
"""First joint (from 0) whose network takes the gripper's states."""

EVERY = 10
"""Of the samples, so many are trained on: one in 0.2 s."""

SETTINGS = Settings(nodes=8, iterations=20)
TRANSFER = Settings(nodes=8, iterations=10)


@dataclass(frozen=True)
class JointNetwork:
    """One joint's network."""

    joint: int  # the joint, from 0
    network: Network  # from states to its torque, N m or N

    def __call__(self, run: PsmRun) -> FloatArray:
        """Return the torque of each sample, shape (n,)."""
        return self.network(states(run, self.network.inputs))[:, 0]


def input_names(joint: int, gripper: bool) -> tuple[str, ...]:
    """Return the inputs of a joint's network: position and velocity of each joint, by age."""
    joints = range(1, GRIPPER + 2 if gripper and joint >= GRIPPER_FROM else GRIPPER + 1)
    return tuple(f"{letter}{k} {back}" for back in WINDOW for letter in "qv" for k in joints)


def states(run: PsmRun, names: Sequence[str], every: int = 1) -> FloatArray:
    """Return a run's states as a network's inputs, shape (n / every, inputs).

    Before a run's first sample its first state stands.
    """
    at = np.arange(0, len(run), every)
    columns = []
    for name in names:
        source = run.position if name[0] == "q" else run.velocity
        joint, back = name[1:].split()
        columns.append(source[np.maximum(at - int(back), 0), int(joint) - 1])
    return np.column_stack(columns)


def trained(
    joint: int, runs: Sequence[PsmRun], validation: Sequence[PsmRun], gripper: bool, seed: int
) -> JointNetwork:
    """Train a joint's (from 0) network in free space; validation runs choose the best step."""
    names, settings = input_names(joint, gripper), replace(SETTINGS, seed=seed)
    return _learnt(joint, runs, validation, names, settings)


def transferred(
    source: JointNetwork, runs: Sequence[PsmRun], validation: Sequence[PsmRun]
) -> JointNetwork:
    """Train a network on with runs of another instrument."""
    names = source.network.inputs
    return _learnt(source.joint, runs, validation, names, TRANSFER, source.network)


def _learnt(
    joint: int,
    runs: Sequence[PsmRun],
    validation: Sequence[PsmRun],
    names: Sequence[str],
    settings: Settings,
    start: Network | None = None,
) -> JointNetwork:
    def table(some: Sequence[PsmRun]) -> tuple[FloatArray, FloatArray]:
        rows = np.concatenate([states(run, names, EVERY) for run in some])
        return rows, np.concatenate([run.torque[::EVERY, [joint]] for run in some])

    rows, torque = table(runs)
    label = (names, ("torque",))
    done = train(rows, torque, label, settings, validation=table(validation), start=start)
    return JointNetwork(joint, done.network)
