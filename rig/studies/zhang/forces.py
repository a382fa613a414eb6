"""Forces: Figures 8 to 10 of Zhang et al. 2022, grasp and wrench, on one simulated arm."""

from dataclasses import dataclass

import numpy as np

from estimation.arm.tables import PSM
from estimation.arm.wrench import body_jacobians, by_pseudo_inverse, in_tip_frame, most_likely
from estimation.recording import FloatArray
from rig.arm.simulated import contact
from rig.studies.zhang.free import NETWORKS, OURS, SETTLE, Cells, side_by_side
from rig.studies.zhang.networks import JointNetwork
from rig.studies.zhang.physics import Physics
from rig.studies.zhang.psm import GRIPPER, RATE_HZ, Psm, PsmRun, simulate
from rig.studies.zhang.psm_motion import (
    ARM_M,
    CONFIGURATIONS_DEG,
    LEAD_SAMPLES,
    Grasp,
    configurations,
    contact_path,
    grasp_and_release,
)

EVERY = 5
"""Of the samples, so many are kept of what is drawn over time."""


@dataclass(frozen=True)
class Learnt:
    """What is known of an arm with one instrument."""

    psm: Psm
    # of joints 1 to 6, trained with the gripper moving and closed
    networks: tuple[JointNetwork, ...]
    gripper: JointNetwork
    physics: Physics

    def external(self, run: PsmRun) -> dict[str, FloatArray]:
        """Return the torque of a run minus that of free motion, by method, shape (n, 7)."""
        free = side_by_side((*self.networks, self.gripper), run)
        return {NETWORKS: run.torque - free, OURS: run.torque - self.physics(run)}


def grasps(learnt: Learnt, rng: np.random.Generator) -> tuple[Cells, Cells]:
    """Return RMSE in N and NRMSE in % of grasping and letting go, each method's scale; and traces.

    The scale, 1/m, is found on another grasp.
    """
    calibration, test = (_grasped(learnt.psm, grasp_and_release(rng), rng) for _ in range(2))
    run, sensed, scored = test
    tested = learnt.external(run)
    cells: Cells = {}
    forces = {"sensor": sensed}
    for method, external in learnt.external(calibration[0]).items():
        scale = _scale(external, *calibration[1:])
        forces[method] = -scale * tested[method][:, GRIPPER]
        error = float(np.sqrt(np.mean((forces[method] - sensed)[scored] ** 2)))
        spread = float(np.ptp(sensed[scored]))
        cells[f"grasp | RMSE, NRMSE, scale | {method}"] = (error, 100 * error / spread, scale)
    return cells, _traces("grasp", forces, scored)


def _traces(experiment: str, forces: dict[str, FloatArray], scored: np.ndarray) -> Cells:
    """Return forces over time, thinned, of an experiment's own samples."""
    kept = np.flatnonzero(scored)[::EVERY]
    time = (kept - kept[0]) / RATE_HZ
    series = {"time, s": time, **{name: force[kept] for name, force in forces.items()}}
    return {
        f"{experiment} | {name}": tuple(map(float, values.round(4)))
        for name, values in series.items()
    }


def _grasped(
    psm: Psm, grasp: Grasp, rng: np.random.Generator
) -> tuple[PsmRun, FloatArray, np.ndarray]:
    """Return a run with a grasp, the force of the resistive sensor, and the scored samples."""
    force = grasp.force(psm)
    run = simulate(psm, grasp.motion, rng, grip_n_m=-ARM_M * force, lead=LEAD_SAMPLES)
    return run, grasp.sensed(force, rng)[LEAD_SAMPLES:], grasp.scored[LEAD_SAMPLES:]


def _scale(external: FloatArray, sensed: FloatArray, scored: np.ndarray) -> float:
    """Return the force a torque stands for, 1/m, as found empirically: by least squares."""
    torque = -external[scored, GRIPPER]
    return float(torque @ sensed[scored] / (torque @ torque))


def turning(learnt: Learnt, rng: np.random.Generator) -> Cells:
    """Return the mean error of grip force in each configuration, N; the scale is found at C1."""
    grasp, place = configurations(rng)
    run, sensed, _ = _grasped(learnt.psm, grasp, rng)
    place = place[LEAD_SAMPLES:]
    cells: Cells = {"C1 to C5 | sensor, N | measured": _means(sensed, place)}
    for method, external in learnt.external(run).items():
        scale = _scale(external, sensed, place == 0)
        force = -scale * external[:, GRIPPER]
        cells[f"C1 to C5 | error, N | {method}"] = _means(force - sensed, place)
    return cells


def _means(values: FloatArray, place: np.ndarray) -> tuple[float, ...]:
    return tuple(float(values[place == k].mean()) for k in range(len(CONFIGURATIONS_DEG)))


def in_contact(learnt: Learnt, rng: np.random.Generator) -> tuple[Cells, Cells]:
    """Return RMSE of force, N, of moment, N m, along the tip's axes, of the grasp, N; and traces.

    The grasp's scale is found before the tip touches.
    """
    grasp = contact_path(rng)
    psm, lead = learnt.psm, LEAD_SAMPLES
    spatial = contact(rng, grasp.motion) * grasp.touching[:, None]
    force = grasp.force(psm)
    run = simulate(psm, grasp.motion, rng, wrench=spatial, grip_n_m=-ARM_M * force, lead=lead)
    sensed, touching = grasp.sensed(force, rng)[lead:], grasp.touching[lead:]
    jacobians = body_jacobians(PSM, run.position[:, :GRIPPER])
    truth = in_tip_frame(PSM, spatial, grasp.motion.position[:, :GRIPPER])[lead:]
    holding = grasp.scored[lead:] & (touching == 0)
    scored = touching > 0
    cells: Cells = {}
    pushes, grips = {"sensor": truth[:, 1]}, {"sensor": sensed}
    for method, external in learnt.external(run).items():
        joints = external[:, :GRIPPER]
        if method == NETWORKS:
            wrench = by_pseudo_inverse(jacobians, joints)
        else:
            wrench = most_likely(jacobians, joints, np.std(joints[~scored][SETTLE:], axis=0)).value
        error = np.sqrt(np.mean((wrench - truth)[scored] ** 2, axis=0))
        pushes[method] = wrench[:, 1]
        grips[method] = -_scale(external, sensed, holding) * external[:, GRIPPER]
        grip_error = float(np.sqrt(np.mean((grips[method] - sensed)[scored] ** 2)))
        cells[f"contact | wrench, grasp | {method}"] = (*map(float, error), grip_error)
    return cells, _traces("contact", pushes, scored) | _traces("held", grips, scored)
