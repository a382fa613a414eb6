"""The simulated grasper's board, as the simulated logger opens it."""

from drivers.teensy.core import FirmwareBoard
from drivers.teensy.fake import PythonBoard
from drivers.teensy.grasper import GRASPER
from drivers.teensy.logic import GRASPER_LOGIC
from drivers.transport.simulated import Board
from rig.configuration.sections import SimulationSection
from rig.errors import UsageError
from rig.grasper.bench import GrasperBench
from rig.grasper.plant import PROTOTYPES
from rig.simulation.logger import uses_firmware


def grasper_board(simulation: SimulationSection) -> tuple[Board, float]:
    """Return the simulated board of a grasper, and its tick, s; UsageError with hidden effects."""
    if simulation.hidden or simulation.draw_hidden is not None:
        raise UsageError(
            "The simulated grasper has no hidden effects.",
            "They are of the reference rig's drive, cable and sensors.",
            "Leave out [simulation] hidden and draw_hidden; spread makes graspers differ.",
        )
    prototype = PROTOTYPES[simulation.grasper]
    bench = GrasperBench(prototype, simulation.seed, simulation.spread)
    tick_s = GRASPER.tick_us * 1e-6
    if uses_firmware(simulation):
        return FirmwareBoard(bench, profile=GRASPER), tick_s
    return PythonBoard(bench, logic=GRASPER_LOGIC), tick_s
