"""Actuator-to-joint coupling of da Vinci instruments, as the da Vinci Research Kit states it.

Numbers: `share/tool/*.json` of jhu-dvrk/sawIntuitiveResearchKit, facts of each instrument model.
Order of the joints: roll, wrist pitch, wrist yaw, jaw. See `rig.grasper.coupling` for the erratum
on the torque matrix printed by Zhang et al. 2022.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rig.grasper.coupling import Coupling, GrasperError

JOINTS = ("roll", "wrist_pitch", "wrist_yaw", "jaw")
ACTUATORS = ("actuator_1", "actuator_2", "actuator_3", "actuator_4")

Row = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class Tool:
    """An instrument family.

    Attributes:
        name: Name of the family.
        models: Model numbers.
        rows: Coupling matrix, joints by actuators.
    """

    name: str
    models: tuple[str, ...]
    rows: tuple[Row, Row, Row, Row]


def _tool(
    name: str, models: str, roll: float, pitch: float, yaw: Sequence[float], jaw: Sequence[float]
) -> Tool:
    """Return a tool with the usual pattern: yaw from actuators 2 to 4, jaw from 3 and 4."""
    rows: tuple[Row, Row, Row, Row] = (
        (roll, 0.0, 0.0, 0.0),
        (0.0, pitch, 0.0, 0.0),
        (0.0, yaw[0], yaw[1], yaw[2]),
        (0.0, 0.0, jaw[0], jaw[1]),
    )
    return Tool(name, tuple(models.split()), rows)


TOOLS: tuple[Tool, ...] = (
    _tool(
        "Cadiere forceps and its group",
        "400049 420049 400006 420006 400048 400179 400181 400036 400033 400007 400001 400178 "
        "400035 400296 420296",
        -1.5632,
        1.0186,
        (-0.8306, 0.6089, 0.6089),
        (-1.2177, 1.2177),
    ),
    _tool(
        "Maryland and fenestrated bipolar forceps",
        "400172 400205",
        -1.563233,
        1.0,
        (-0.630273, 0.457982, 0.457982),
        (-0.915964, 0.915964),
    ),
    _tool(
        "ProGrasp forceps",
        "400093 420093",
        -1.5631,
        1.0,
        (-0.5068, -0.5135, -0.5135),
        (-0.5279, 0.5279),
    ),
    _tool(
        "Small clip applier",
        "400003",
        -1.5632,
        1.0186,
        (-0.8349, -0.5956, -0.5956),
        (1.1913, -1.1913),
    ),
    _tool(
        "Mega needle driver",
        "400194",
        -1.5575,
        1.0,
        (-0.456081, 0.368243, 0.368243),
        (-0.736486, 0.736486),
    ),
    _tool(
        "Mega SutureCut needle driver",
        "400309",
        -1.5575,
        1.0,
        (-0.579399, 0.467811, 0.467811),
        (-0.935622, 0.935622),
    ),
    _tool(
        "Bowel, double fenestrated, tenaculum and thoracic graspers",
        "400127 400189 400207 400208",
        -1.5575,
        1.0,
        (-0.5, 0.368243, 0.368243),
        (-0.736486, 0.736486),
    ),
    _tool(
        "Large clip applier",
        "400230",
        -1.563131,
        1.0,
        (-0.506756, 0.513513, 0.513513),
        (0.527898, -0.52789),
    ),
    Tool(
        "5 mm snake instruments",
        ("400143", "400117"),
        (
            (-1.5, 0.0, 0.0, 0.0),
            (0.0, 0.0, -0.1929, -0.1929),
            (0.0, 0.0, -0.1929, 0.1929),
            (0.0, -1.258, 0.0, 0.0),
        ),
    ),
)


def dvrk_coupling(model: str) -> Coupling:
    """Return the coupling of an instrument model.

    Args:
        model: Model number, such as `420049`.

    Raises:
        GrasperError: The model is not in the table.
    """
    for tool in TOOLS:
        if model in tool.models:
            name = f"{tool.name} {model}"
            return Coupling(name, JOINTS, ACTUATORS, np.array(tool.rows))
    known = ", ".join(sorted(number for tool in TOOLS for number in tool.models))
    raise GrasperError(f"There is no coupling for the model {model!r}.", f"Known: {known}.")
