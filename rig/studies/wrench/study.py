"""Tables 3.1 to 3.3 of Piqué 2018 on simulated arms: free space, a hand's motion, and contact.

Each arm has a hidden torque of one family, which no model declares. It is excited, identified, and
tested on other motions and in contact with a force sensor of its own faults. The thesis' own method
first; then columns filtered as the torque, the effects found within the excitation, and joints
weighed by their errors; then the same with a window of past samples in place of the zero-phase
filter.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.signal import savgol_filter
from scipy.spatial.transform import Rotation

from estimation.arm.base import base_of
from estimation.arm.effects import ArmEffect, of_joints
from estimation.arm.identification import fit, nrmsd_percent, smoothed, thesis_weights
from estimation.arm.motion import FINE, LOW_PASS, Motion, motion_of
from estimation.arm.regressor import regressor
from estimation.arm.tables import PSM
from estimation.arm.wrench import (
    body_jacobians,
    by_pseudo_inverse,
    in_tip_frame,
    most_likely,
    spatial_jacobians,
)
from estimation.filters import zero_phase
from estimation.recording import FloatArray
from rig.arm import search
from rig.arm.hidden import FAMILIES
from rig.arm.search import Prepared
from rig.arm.simulated import (
    RATE_HZ,
    ArmRun,
    SimulatedArm,
    contact_motion,
    draw_arm,
    excitation,
    passed_on,
    pin,
    recorded,
    simulate,
    smooth_motion,
)
from rig.output.provenance import Provenance
from rig.studies.families import arm_of
from rig.studies.seeds import Keeper, kept_outcomes

SCHEMA = "rig.study.pique.wrench/3"

THESIS = "thesis' method"
OURS = "with effects found and errors weighed"
CAUSAL = "the same, causal"

TABLES = {
    "3.1, a hand's motion": (5.92, 5.78, 18.84, 10.41, 16.84, 22.96),
    "3.2, another Fourier series": (2.38, 4.80, 12.83, 6.49, 15.29, 18.11),
    "3.3, contact": (8.26, 5.96, 6.10, 8.13, 5.71, 15.50),
}
"""NRMSD of the thesis, %: joints 1 to 6, then Fx Fy Fz Tx Ty Tz in the base frame."""

HAND, SERIES, CONTACT = TABLES
BODY = "3.3 in the tip's frame, by the body Jacobian"
"""The same contact in the tip's frame; the thesis gives no numbers of it."""

PUSHED = ((5.0, 7.0, 7.0), 0.0)
TWISTED = ((2.3, 4.0, 5.0), 0.1)
"""Largest forces along the base's axes, N, and torsion, N m, where the thesis measured forces and
where it measured moments. It names up to 7 N and states no sizes; these are set so that its method
meets its table 3.3."""

CUT = slice(100, -100)
WINDOW, ORDER = 25, 3
"""Samples and degree of the causal window: a quarter of a second, an eighth late."""

JOINTS_ALONE = replace(PSM, wrist=None, wrist_coupling=())
"""The arm by its joints: the simulated one has no cables between them, and none are searched."""


@dataclass(frozen=True)
class Arm:
    """One arm's results."""

    family: str
    errors: dict[str, dict[str, tuple[float, ...]]]  # NRMSD, %, by table and, in it, by method
    effects: tuple[str, ...]


@dataclass(frozen=True)
class WrenchStudy:
    """Results of the simulated study."""

    schema: str
    seeds: int  # arms of each family
    arms: tuple[Arm, ...]
    provenance: Provenance

    def errors(self, family: str, table: str, method: str) -> FloatArray:
        """Return the errors of a family's arms, %, shape (arms, 6)."""
        own = [arm for arm in self.arms if arm.family == family]
        return np.array([arm.errors[table][method] for arm in own])


def run(seeds: int, keeper: Keeper) -> WrenchStudy:
    """Do the study on so many arms of every family, from seed 0.

    Raises:
        OSError: The folder cannot be written.
    """
    arms = kept_outcomes(Arm, one_arm, seeds * len(FAMILIES), SCHEMA, keeper)
    return WrenchStudy(SCHEMA, seeds, tuple(arms), Provenance.now(0))


def one_arm(number: int) -> Arm:
    """Do one arm."""
    seed, family = arm_of(number)
    rng = np.random.default_rng([seed, 20180])
    arm = draw_arm(rng, family)
    learnt = simulate(arm, excitation(rng), rng)
    motions = {HAND: smooth_motion(rng, 40.0), SERIES: excitation(rng, 40.0)}
    free = {table: simulate(arm, motion, rng) for table, motion in motions.items()}
    touches = [_touched(arm, rng, *sizes) for sizes in (PUSHED, TWISTED)]
    errors: dict[str, dict[str, tuple[float, ...]]] = {table: {} for table in (*TABLES, BODY)}
    effects = found_effects(learnt)
    for method, columns_of, filtered in (
        (THESIS, _thesis_columns, _filtered),
        (OURS, partial(_our_columns, effects), _filtered),
        (CAUSAL, partial(_causal_columns, effects), _smoothed),
    ):
        own, torque = columns_of(learnt), filtered(learnt.torque)
        if method == THESIS:
            values = fit(own, torque, thesis_weights(torque)).values
        else:
            values = _path(own, torque, effects).values([effect.name for effect in effects])
        left = np.std(torque - own @ values, axis=0)
        for table, run in free.items():
            error = nrmsd_percent(columns_of(run) @ values, filtered(run.torque))
            errors[table][method] = tuple(map(float, error))
        for table, jacobians_of in ((CONTACT, spatial_jacobians), (BODY, body_jacobians)):
            both = []
            for touch, sensor in touches:
                external = filtered(touch.torque) - columns_of(touch) @ values
                jacobians = jacobians_of(PSM, filtered(touch.position))
                if method == THESIS:
                    wrench = by_pseudo_inverse(jacobians, external)
                else:
                    wrench = most_likely(jacobians, external, left).value
                seen = sensor if table == CONTACT else in_tip_frame(PSM, sensor, touch.position)
                both.append(nrmsd_percent(wrench, filtered(seen)))
            errors[table][method] = tuple(map(float, [*both[0][:3], *both[1][3:]]))
    return Arm(family, errors, tuple(effect.name for effect in effects))


def found_effects(run: ArmRun) -> list[ArmEffect]:
    """Return the effects that help from some segments of an excitation to the others and back."""
    tried = of_joints(JOINTS_ALONE)
    path = _path(_our_columns(tried, run), _filtered(run.torque), tried)
    whole = recorded("excitation", run.position, run.torque, RATE_HZ)
    kept = search.chosen_within(path, whole, tried)
    return [effect for effect in tried if effect.name in kept]


def _path(table: FloatArray, torque: FloatArray, effects: Sequence[ArmEffect]) -> Prepared:
    """Return columns of the base and of effects, thinned, ready to be fitted or searched."""
    every = round(RATE_HZ / (search.RATE_SHARE * LOW_PASS.cutoff_hz))
    still = motion_of(np.zeros((50, len(PSM.joints))), 1 / RATE_HZ, FINE)
    widths = [effect.columns(still).shape[2] for effect in effects]
    blocks = search.blocks_of(search.base_block(search.DAMPING), effects, widths)
    return search.of_columns("excitation", torque[::every], table[::every], blocks, len(PSM.joints))


def _touched(
    arm: SimulatedArm,
    rng: np.random.Generator,
    largest_n: tuple[float, float, float],
    torsion_n_m: float,
) -> tuple[ArmRun, FloatArray]:
    """Return the readings of an arm's sensors in contact with a pin, and of the force sensor."""
    motion = contact_motion(rng, 60.0)
    wrench = pin(rng, motion, largest_n, torsion_n_m)
    return simulate(arm, motion, rng, wrench), ati(passed_on(motion, wrench), rng)


def _filtered(values: FloatArray) -> FloatArray:
    return zero_phase(values, RATE_HZ, LOW_PASS)[CUT]


def _thesis_columns(run: ArmRun) -> FloatArray:
    motion = motion_of(run.position, 1 / RATE_HZ, LOW_PASS)
    return regressor(PSM, motion)[CUT][:, :, base_of(PSM).columns]


def _our_columns(effects: Sequence[ArmEffect], run: ArmRun) -> FloatArray:
    columns = _with(effects, motion_of(run.position, 1 / RATE_HZ, FINE))
    return smoothed(columns, RATE_HZ, LOW_PASS)[CUT]


def _smoothed(values: FloatArray, derivative: int = 0) -> FloatArray:
    """Return the result of a window of past samples, half a window late, as `LiveWrench` does."""
    return savgol_filter(values, WINDOW, ORDER, deriv=derivative, delta=1 / RATE_HZ, axis=0)[CUT]


def _causal_columns(effects: Sequence[ArmEffect], run: ArmRun) -> FloatArray:
    position, velocity, acceleration = (_smoothed(run.position, k) for k in range(3))
    return _with(effects, Motion(position, velocity, acceleration, 1 / RATE_HZ))


def _with(effects: Sequence[ArmEffect], motion: Motion) -> FloatArray:
    own = regressor(PSM, motion)[:, :, base_of(PSM).columns]
    return np.concatenate([own, *(effect.columns(motion) for effect in effects)], axis=2)


def ati(wrench: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return the reading of a force sensor under the pin for a wrench.

    Noise, a bias, drift, cross-talk of 1 % and a frame turned by 1 degree and moved by 1 mm:
    within the makers' specifications and the accuracy of mounting by hand.
    """
    full = np.repeat([7.0, 1.0], 3)
    turn = Rotation.from_rotvec(np.radians(1.0) * rng.normal(size=3) / np.sqrt(3)).as_matrix()
    offset = 1e-3 * rng.normal(size=3)
    force, moment = wrench[:, :3] @ turn.T, wrench[:, 3:] @ turn.T
    seen = np.hstack([force, moment + np.cross(offset, force)])
    mixing = np.eye(6) + 0.01 * rng.uniform(-1, 1, (6, 6)) * full[:, None] / full
    drift = np.linspace(0, 1, len(wrench))[:, None] * 0.01 * full * rng.normal(size=6)
    bias = 0.005 * full * rng.normal(size=6)
    noise = 0.004 * full * rng.normal(size=seen.shape)
    return np.asarray(seen @ mixing.T + bias + drift + noise)
