"""A campaign of the simulated rig without logs in between: each run is simulated when it is read.

For studies that need many runs and no bytes. `rig record` goes the whole way instead, through the
logger's frames, its driver and the log.
"""

from collections.abc import Sequence
from functools import partial

import numpy as np

from estimation.campaign import Campaign, Run
from estimation.recording import Instrument, Recording
from rig.protocols.motion import motion_of
from rig.protocols.protocol import RunPlan, load_protocol
from rig.protocols.trajectory import SAMPLE_RATE_HZ
from rig.simulation.bench import SimulatedBench
from rig.simulation.hidden import HiddenEffect, table
from rig.simulation.parameters import PlantParameters
from rig.simulation.play import play


def simulate_reference_campaign(
    seed: int = 0,
    protocol: str = "reference",
    effects: Sequence[HiddenEffect] = (),
    parameters: PlantParameters | None = None,
) -> Campaign:
    """Return a campaign of the simulated rig.

    Args:
        seed: Seed of the sensors' noise; each run has its own, made of this and its number.
        protocol: Protocol file or the name of a shipped one.
        effects: Hidden effects switched on in every run.
        parameters: Of the simulated rig; the reference rig's by default.

    Raises:
        UsageError: The protocol does not exist, or no such effect.
    """
    plans = load_protocol(protocol).plans()
    table(effects)  # an unknown name is refused now
    return Campaign(
        tuple(
            Run(p.name, partial(_simulate, p, seed, i, effects, parameters))
            for i, p in enumerate(plans)
        )
    )


def _simulate(
    plan: RunPlan,
    seed: int,
    index: int,
    effects: Sequence[HiddenEffect],
    parameters: PlantParameters | None,
) -> Recording:
    bench = SimulatedBench(parameters, effects=effects, seed=seed * 100_003 + index)
    motion = motion_of(plan, float(plan.target_angle_rad[0]))
    columns = play(bench, *motion.setpoints)
    run = slice(motion.first, motion.last)
    columns = {name: values[run] for name, values in columns.items()}
    return Recording(
        plan.name,
        np.arange(motion.last - motion.first) / SAMPLE_RATE_HZ,
        columns,
        conditions=plan.conditions,
        rig="simulated rig",
        instrument=Instrument(model="Maryland", serial="SIM-TOOL-1", side="left"),
        source=f"simulated, seed {seed}",
    )
