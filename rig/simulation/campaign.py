"""Runs of the simulated rig without logs in between.

For studies that need many runs and no bytes. `rig record` goes the whole way instead, through the
logger's frames, its driver and the log.
"""

from collections.abc import Iterable, Sequence
from functools import partial

import numpy as np

from estimation.campaign import Campaign, Run
from estimation.recording import Instrument, Recording
from rig.protocols.motion import motion_of
from rig.protocols.protocol import RunPlan, load_protocol
from rig.protocols.trajectory import SAMPLE_RATE_HZ
from rig.simulation.bench import SimulatedBench
from rig.simulation.hidden import HiddenEffect, table
from rig.simulation.parameters import PlantParameters, SensorParameters
from rig.simulation.sensors import spindle_count_of


def bench_at(
    angle_rad: float,
    plant: PlantParameters | None = None,
    sensors: SensorParameters | None = None,
    effects: Iterable[HiddenEffect] = (),
    seed: int = 0,
) -> SimulatedBench:
    """Return a bench whose spindle stands at an angle, closing positive."""
    count = spindle_count_of(angle_rad, sensors or SensorParameters())
    return SimulatedBench(plant, sensors, effects, seed, count)


def simulated_run(bench: SimulatedBench, plan: RunPlan, source: str) -> Recording:
    """Return one run of a bench, which stands at the start of the plan or near it.

    The load is ramped up before it, as when a rig is recorded.
    """
    motion = motion_of(plan, float(plan.target_angle_rad[0]))
    columns = bench.play(*(values[: motion.last] for values in motion.setpoints))
    return Recording(
        plan.name,
        np.arange(motion.last - motion.first) / SAMPLE_RATE_HZ,
        {name: values[motion.first :] for name, values in columns.items()},
        conditions=plan.conditions,
        rig="simulated rig",
        instrument=Instrument(model="Maryland", serial="SIM-TOOL-1", side="left"),
        source=source,
    )


def simulate_reference_campaign(
    seed: int = 0,
    protocol: str = "reference",
    effects: Sequence[HiddenEffect] = (),
    parameters: PlantParameters | None = None,
) -> Campaign:
    """Return a campaign of the simulated rig; each run is simulated when it is read.

    The sensors' noise of each run has a seed of its own, made of this one and its number. The
    protocol is a file or the name of a shipped one; the hidden effects are on in every run.

    Raises:
        UsageError: The protocol does not exist, or no such effect.
    """
    table(effects)  # an unknown name is refused now
    plans = load_protocol(protocol).plans()
    runs = [
        Run(plan.name, partial(_run, plan, seed, k, effects, parameters))
        for k, plan in enumerate(plans)
    ]
    return Campaign(tuple(runs))


def _run(
    plan: RunPlan,
    seed: int,
    index: int,
    effects: Sequence[HiddenEffect],
    parameters: PlantParameters | None,
) -> Recording:
    bench = SimulatedBench(parameters, effects=effects, seed=seed * 100_003 + index)
    return simulated_run(bench, plan, f"simulated, seed {seed}")
