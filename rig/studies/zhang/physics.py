"""Our method: an arm's model, effects found by search, and a network on the residual.

Everything is causal, as the networks are: friction's memory is walked along the measured path, and
velocity and acceleration are those of a polynomial through past positions, at its end. What the
coupling matrix gets wrong shows in joints 3 to 6 as a share of the gripper's measured torque, so
that torque is an input of theirs.

The residual is mostly friction with memory, which presliding springs model only approximately. It
does not follow from a joint's position and velocity alone, so the inputs of each network include
the deflections of such springs too, of the joint itself or, in the wrist, of the motors behind the
coupling.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import signal

from estimation.arm.base import base_of
from estimation.arm.effects import ArmEffect, on_joint, slip
from estimation.arm.motion import Motion
from estimation.arm.regressor import regressor
from estimation.arm.tables import PSM, Arm
from estimation.arm.wrist import candidates, gripper
from estimation.networks.network import Network
from estimation.networks.training import Settings, train
from estimation.recording import FloatArray
from rig.arm.search import DAMPING, Prepared, base_block, blocks_of, of_columns, search
from rig.studies.zhang.psm import GRIPPER, JOINTS, RATE_HZ, PsmRun

EVERY = 5
"""Of the samples, so many are fitted: ten a second."""

SETTLE = 100
"""Samples at the start of a run that are not fitted: slip elements have not slipped yet."""

WINDOW, DEGREE = 15, 4
"""Past samples that velocity and acceleration come from, and the degree of their polynomial. At
its end, they barely lag; differences of past velocities lag, which shows as late torque."""

CLOSED_RAD = 0.03
"""Angle below which the jaws touch."""

LEAKS = (2, 3, 4, 5)
"""Joints (from 0) that show a share of the gripper's torque."""

GRIPPER_FRICTIONS = (False, False, True, True, False, False, *(False for _ in LEAKS))
"""Of each declared column behind those of the arm, whether it is a friction."""

LONG_SLIP_SHARE = (0.01, 0.03, 0.1, 0.2)
"""Thresholds of slip, as shares of half a joint's range."""

DRAG_RAD_S = (0.05, 0.2)
"""Speeds over which the drag of the gripper's cables turns."""

JOINT_SLIP_SHARE = (0.01, 0.03, 0.06, 0.1, 0.2, 0.4)
"""Ways after which the springs of joints 1 to 4 slip, as shares of half a joint's range."""

MOTOR_SLIP_RAD = (0.03, 0.1, 0.2, 0.4)
"""The same of the wrist's motors."""

SETTINGS = Settings(nodes=4, iterations=60)

HELD_OUT = 6
"""Every so many pieces of the samples choose the step, and whether the network is kept."""

LEAST_GAIN = 0.1
"""Share of the squared residual on those segments that a network must remove to be kept. Below,
it fits noise: the residual does not depend on these states."""


def motion_of_run(run: PsmRun) -> Motion:
    """Return a run's motion as it is known at each sample; before its first one it stood still."""
    known = np.vstack([np.repeat(run.position[:1], WINDOW, axis=0), run.position])

    def derivative(order: int) -> FloatArray:
        last, step = WINDOW - 1, 1 / RATE_HZ
        taps = signal.savgol_coeffs(WINDOW, DEGREE, deriv=order, delta=step, pos=last)
        found: FloatArray = np.asarray(signal.lfilter(taps, [1.0], known, axis=0), np.float64)
        return found[WINDOW:]

    return Motion(run.position, derivative(1), derivative(2), 1 / RATE_HZ)


def base_columns(arm: Arm, run: PsmRun, motion: Motion) -> FloatArray:
    """Return the declared columns, shape (n, 7, k): arm, gripper, and leaks of its torque."""
    own = regressor(PSM, motion)[:, :, base_of(PSM).columns]
    angle, grip = run.position[:, GRIPPER], run.torque[:, [GRIPPER]]
    return np.concatenate(
        [
            np.pad(own, ((0, 0), (0, 1), (0, 0))),
            gripper(arm, motion),
            on_joint(np.column_stack([angle, angle < CLOSED_RAD]), GRIPPER, JOINTS),
            *(on_joint(grip, k, JOINTS) for k in LEAKS),
        ],
        axis=2,
    )


def of_long_slips() -> list[ArmEffect]:
    """Return slips of joints 1 to 4 over longer ways than the catalogue of arm effects holds."""

    def long(k: int) -> ArmEffect:
        half = (PSM.joints[k].upper - PSM.joints[k].lower) / 2

        def columns(motion: Motion) -> FloatArray:
            position = motion.position[:, [k]]
            slips = [slip(position, share * half) for share in LONG_SLIP_SHARE]
            return on_joint(np.hstack(slips), k, JOINTS)

        return ArmEffect(f"long slip J{k + 1}", "elastic slip over long ways", columns, True)

    return [long(k) for k in range(4)]


def of_moving_gripper() -> list[ArmEffect]:
    """Return drags of the moving gripper's cables on the joints they run through."""

    def drag(k: int) -> ArmEffect:
        return ArmEffect(
            f"gripper drag on J{k + 1}",
            "friction of the moving gripper's cables on a joint that they run through",
            lambda m: on_joint(np.tanh(m.velocity[:, [GRIPPER]] / DRAG_RAD_S), k, JOINTS),
        )

    return [drag(k) for k in (*LEAKS, GRIPPER)]


@dataclass(frozen=True)
class Physics:
    """A fitted arm: declared columns, the effects found, and networks on the residual."""

    arm: Arm  # the arm with its instrument's nominal coupling
    effects: tuple[ArmEffect, ...]  # what was found, in order
    values: FloatArray  # parameters of the declared columns, then of the effects
    # for each joint, the network on the residual; None where none improves it
    rest: tuple[Network | None, ...]

    def __call__(self, run: PsmRun, network: bool = True) -> FloatArray:
        """Return the torque of each sample in free space, shape (n, 7).

        Of the run's torque only the gripper's is looked at, for the leaks.
        """
        torque: FloatArray = columns_of(self.arm, self.effects, run) @ self.values
        if network:
            motion = motion_of_run(run)
            for k, rest in enumerate(self.rest):
                if rest is not None:
                    torque[:, k] += rest(rest_rows(self.arm, k, motion))[:, 0]
        return torque


def columns_of(arm: Arm, effects: Sequence[ArmEffect], run: PsmRun) -> FloatArray:
    """Return declared columns and those of effects, shape (n, 7, k)."""
    motion = motion_of_run(run)
    parts = [base_columns(arm, run, motion), *(effect.columns(motion) for effect in effects)]
    return np.concatenate(parts, axis=2)


def prepared(name: str, arm: Arm, runs: Sequence[PsmRun], effects: Sequence[ArmEffect]) -> Prepared:
    """Return runs ready for fits and for the search."""
    kept = slice(SETTLE, None, EVERY)
    table = np.concatenate([columns_of(arm, effects, run)[kept] for run in runs])
    torque = np.concatenate([run.torque[kept] for run in runs])
    begun = motion_of_run(runs[0].part(0, WINDOW))
    widths = [effect.columns(begun).shape[2] for effect in effects]
    blocks = blocks_of(base_block(DAMPING, GRIPPER_FRICTIONS), effects, widths)
    return of_columns(name, torque, table, blocks, JOINTS)


def find_effects(arm: Arm, first: Sequence[PsmRun], second: Sequence[PsmRun]) -> list[ArmEffect]:
    """Return the effects that help from some runs to others and back, by the search on arms."""
    tried = [*candidates(arm), *of_long_slips(), *of_moving_gripper()]
    one, other = (
        prepared(name, arm, runs, tried) for name, runs in (("first", first), ("second", second))
    )
    kept = search((one, other), (other, one), tried)[1]
    named = {effect.name: effect for effect in tried}
    return [named[name] for name in kept]


def fitted(arm: Arm, effects: Sequence[ArmEffect], runs: Sequence[PsmRun]) -> Physics:
    """Fit an arm with given effects, then a small network on each joint's rest."""
    path = prepared("fitted", arm, runs, effects)
    values = path.values([effect.name for effect in effects])
    left = path.torque - path.table @ values
    motions = [motion_of_run(run) for run in runs]

    def rest(k: int) -> Network | None:
        rows = [rest_rows(arm, k, motion)[SETTLE::EVERY] for motion in motions]
        return rest_network(np.concatenate(rows), left[:, k])

    return Physics(arm, tuple(effects), values, tuple(rest(k) for k in range(JOINTS)))


def rest_rows(arm: Arm, joint: int, motion: Motion) -> FloatArray:
    """Return the states that the network on a joint's rest takes, shape (n, inputs).

    The motion has the gripper too, and is walked from its start.
    """
    wrist = len(PSM.joints) if arm.wrist is None else arm.wrist
    if joint < wrist:
        half = (arm.joints[joint].upper - arm.joints[joint].lower) / 2
        position, velocity = motion.position[:, [joint]], motion.velocity[:, [joint]]
        ways = [share * half for share in JOINT_SLIP_SHARE]
    else:
        inverse = np.linalg.inv(np.array(arm.wrist_coupling)).T
        driven = slice(wrist, wrist + len(inverse))
        position, velocity = (x[:, driven] @ inverse for x in (motion.position, motion.velocity))
        ways = list(MOTOR_SLIP_RAD)
    return np.hstack([position, velocity, *(slip(position, way) for way in ways)])


def rest_network(rows: FloatArray, left: FloatArray) -> Network | None:
    """Return a network from rows (n, inputs) to a residual (n,).

    None where it improves held-out segments too little.
    """
    piece = np.arange(len(rows)) * 3 * HELD_OUT // len(rows)
    out = piece % HELD_OUT == HELD_OUT - 1
    names: Sequence[str] = [f"state {k}" for k in range(rows.shape[1])]
    network = train(
        rows[~out],
        left[~out, None],
        (names, ("rest",)),
        SETTINGS,
        validation=(rows[out], left[out, None]),
    ).network
    after = np.sum((left[out] - network(rows[out])[:, 0]) ** 2)
    return network if after < (1 - LEAST_GAIN) * np.sum(left[out] ** 2) else None
