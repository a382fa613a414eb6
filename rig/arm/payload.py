"""A mass added to a patient-side manipulator's insertion axis, from its joints' torque.

A model is fitted to a run without the mass and estimates runs with it; the residual of the joints
that lift the mass determines the mass.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from estimation.arm.effects import ArmEffect
from estimation.arm.identification import smoothed
from estimation.arm.motion import FINE, LOW_PASS, joint_channels, motion_of
from estimation.arm.payload import LEAST_PERIODS, SIDE_STEP_M, AddedMass, added_mass, carried_torque
from estimation.arm.tables import PSM, PointMass
from estimation.arm.wrist import candidates
from estimation.recording import FloatArray, Recording
from rig.arm.search import EDGE_S, RATE_SHARE, Prepared, period_of, prepare
from rig.errors import DataError
from rig.output.page import Page
from rig.output.provenance import Provenance
from rig.output.table import TextTable

LINK = 2
"""The mass turns with joints 1 and 2; the insertion does not move it."""

LIFTING = [0, 1]

OTHER_MOUNTINGS = ("parallel",)
"""Words in a run's name that state another place of the mass. Its distance from the axes is not
that of the insertion axis, and gravity shows only mass times distance."""

EFFECTS = ("presliding J1", "presliding J2")
"""The first effect that `rig study pique` keeps on each lifting joint. The later ones, springs and
ripples by position, change between sessions and would take a share of the mass."""

DAMPING = 1e-5
"""Of the model's fit. A fit damped as the search's is off by a share of what the arm itself weighs,
which at another speed looks like a mass: 13 g of 80 g on a simulated arm."""


@dataclass(frozen=True)
class Payload:
    """Added masses of some runs, by a model fitted on another one.

    The height is that of the mass above the remote centre, with its standard error.
    """

    schema: str
    model: str
    height_m: float
    height_error_m: float
    runs: tuple[str, ...]
    masses: tuple[AddedMass, ...]
    provenance: Provenance


def find_payload(
    model: Recording,
    runs: Sequence[Recording],
    height_m: float,
    height_error_m: float,
    on_run: Callable[[str], None] = lambda name: None,
) -> Payload:
    """Fit a model on a run without the mass and find what was added on others.

    The mass is at a height above the remote centre, with a standard error. `on_run` is called with
    the name of each run before its turn.

    Raises:
        DataError: A run is too short, lacks a joint, or is named after another mounting.
        ArmError: A run has too few periods.
    """
    for run in runs:
        stated = [word for word in OTHER_MOUNTINGS if word in run.name.lower()]
        if stated:
            raise DataError(
                f"The run {run.name!r} states the mounting {stated[0]!r}, whose geometry is not"
                " modelled.",
                "The mass is taken to be fixed on the base of the insertion axis. Torque shows mass"
                " times distance from the joint's axis, so another place gives another mass.",
                "Leave the run out.",
            )
    tried = [effect for effect in candidates(PSM) if effect.name in EFFECTS]
    kept = [effect.name for effect in tried]
    fitted = prepare(model, tried, DAMPING)
    values = fitted.values(kept)
    noise = _left(fitted, kept, values).std(axis=0)
    masses = []
    for run in runs:
        on_run(run.name)
        masses.append(_mass(run, tried, values, noise, height_m, height_error_m))
    return Payload(
        schema="rig.study.payload/1",
        model=model.name,
        height_m=height_m,
        height_error_m=height_error_m,
        runs=tuple(run.name for run in runs),
        masses=tuple(masses),
        provenance=Provenance.now(0),
    )


def _mass(
    run: Recording,
    tried: Sequence[ArmEffect],
    values: FloatArray,
    noise: FloatArray,
    height_m: float,
    height_error_m: float,
) -> AddedMass:
    path, kept = prepare(run, tried), [effect.name for effect in tried]
    third = len(path.torque) // LEAST_PERIODS  # in place of a period where the motion repeats less
    straight = _unit(run, (0.0, height_m, 0.0), len(path.torque))

    def beside(x_m: float, z_m: float) -> FloatArray:
        return _unit(run, (x_m, height_m, z_m), len(path.torque)) - straight

    return added_mass(
        _left(path, kept, values),
        (straight, beside(SIDE_STEP_M, 0.0), beside(0.0, SIDE_STEP_M)),
        _unit(run, (0.0, height_m + height_error_m, 0.0), len(path.torque)),
        noise,
        min(round(period_of(run) or third), third),
    )


def _left(path: Prepared, kept: Sequence[str], values: FloatArray) -> FloatArray:
    return (path.torque[:, : path.joints] - path.estimate(kept, values))[:, LIFTING]


def _unit(run: Recording, point_m: tuple[float, float, float], length: int) -> FloatArray:
    """Return one kilogram's torque on the lifting joints, filtered and thinned as the path is."""
    rate_hz = run.sample_rate_hz
    position, _, _ = joint_channels(run)
    loaded = PSM.with_payload(PointMass("one kilogram", LINK, point_m, 1.0))
    torque = carried_torque(loaded, motion_of(position, 1 / rate_hz, FINE))
    every = max(1, round(rate_hz / (RATE_SHARE * LOW_PASS.cutoff_hz)))
    start = round(EDGE_S * rate_hz)
    return smoothed(torque[:, LIFTING, None], rate_hz)[start::every, :, 0][:length]


def page(study: Payload) -> Page:
    """Return the page of the masses."""
    rows = []
    for name, found in zip(study.runs, study.masses, strict=True):
        low, high = found.interval_kg
        grams = (found.mass_kg, low, high, *found.by_joint_kg)
        rows.append([name, *(f"{1000 * value:.1f}" for value in grams)])
    table = TextTable(
        f"Mass added, g, by a model fitted on {study.model}",
        ["run", "mass", "from", "to", "J1 alone", "J2 alone"],
        rows,
        f"At {100 * study.height_m:g} cm above the remote centre, standard error"
        f" {100 * study.height_error_m:g} cm; its distance from the axis is estimated. The interval"
        " is two standard errors: scatter over periods, half the joints' difference, the lever.",
    )
    return Page("Masses added to an arm", [], [table], study.provenance)
