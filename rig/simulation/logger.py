"""Open the simulated logger: plant, board and a transport in virtual time."""

from drivers.teensy.core import FirmwareBoard, firmware_library
from drivers.teensy.fake import PythonBoard
from drivers.teensy.reference import REFERENCE
from drivers.transport.simulated import Board, SimulatedTransport
from rig.configuration.config import Config
from rig.configuration.machine_settings import installed
from rig.configuration.sections import SimulationSection
from rig.machines.choose import SIMULATED_BOARDS
from rig.simulation import hidden, parameters
from rig.simulation.bench import SimulatedBench
from rig.simulation.fitted import DECLARED_PLANT

PACED_STEP_S = 0.05
UNPACED_STEP_S = 0.2


def open_simulated_logger(
    config: Config, pace: float | None = None, step_s: float | None = None
) -> SimulatedTransport:
    """Return the transport of a simulated rig: the board of the configuration's profile.

    The pace is virtual seconds a real second, None for as fast as possible; `step_s` the longest
    virtual time between looks at the board, always shorter than the board waits for its host.

    Raises:
        UnknownHiddenEffectError: A hidden effect has no such name.
        UsageError: No simulated board is installed for the profile.
    """
    board, tick_s = installed(SIMULATED_BOARDS, config.logger.profile)(config.simulation)
    # a rig faster than real time is not displayed, so it may advance in larger steps
    usual_s = UNPACED_STEP_S if pace is None else PACED_STEP_S
    step_s = min(step_s or usual_s, 0.8 * config.safety.watchdog_s)
    return SimulatedTransport(board, config.logger.url, step_s=step_s, pace=pace, tick_s=tick_s)


def reference_board(simulation: SimulationSection) -> tuple[Board, float]:
    """Return the simulated board of the reference rig, and its tick, s."""
    plant, sensors, effects = plant_and_sensors(simulation)
    bench = SimulatedBench(plant, sensors, effects, simulation.seed)
    firmware = uses_firmware(simulation)
    return FirmwareBoard(bench) if firmware else PythonBoard(bench), REFERENCE.tick_us * 1e-6


def plant_and_sensors(
    simulation: SimulationSection,
) -> tuple[parameters.PlantParameters, parameters.SensorParameters, list[hidden.HiddenEffect]]:
    """Return the plant, the sensors and the hidden effects of a simulated rig.

    Raises:
        UnknownHiddenEffectError: A hidden effect has no such name.
    """
    effects = [hidden.HiddenEffect(name, value) for name, value in simulation.hidden.items()]
    if simulation.draw_hidden is not None:
        effects.append(hidden.draw(simulation.draw_hidden))
    declared = simulation.plant == "declared"
    plant = DECLARED_PLANT if declared else parameters.PlantParameters()
    sensors = parameters.SensorParameters()
    if simulation.spread:
        plant = parameters.vary(plant, simulation.seed, simulation.spread)
        sensors = parameters.vary(sensors, simulation.seed, simulation.spread)
    return plant, sensors, effects


def uses_firmware(simulation: SimulationSection) -> bool:
    """Whether the compiled firmware core is in the loop, rather than the plain board."""
    return simulation.firmware and firmware_library() is not None
