"""Actuator-to-joint coupling of da Vinci instruments, as the da Vinci Research Kit states it.

The numbers are in `dvrk.toml`. Order of the joints: roll, wrist pitch, wrist yaw, jaw. See
`rig.grasper.coupling` for the erratum on the torque matrix printed by Zhang et al. 2022.
"""

import tomllib
from functools import cache
from pathlib import Path

import numpy as np

from rig.grasper.coupling import Coupling, GrasperError

JOINTS = ("roll", "wrist_pitch", "wrist_yaw", "jaw")


@cache
def dvrk_couplings() -> dict[str, Coupling]:
    """Return the coupling of every instrument model, by its number."""
    tools = tomllib.loads(Path(__file__).with_suffix(".toml").read_text())["tool"]
    return {
        model: Coupling(f"{tool['name']} {model}", JOINTS, np.array(tool["matrix"]))
        for tool in tools
        for model in tool["models"].split()
    }


def dvrk_coupling(model: str) -> Coupling:
    """Return the coupling of an instrument model by its number, such as `420049`.

    Raises:
        GrasperError: The model is not in the table.
    """
    known = dvrk_couplings()
    if model not in known:
        raise GrasperError(
            f"There is no coupling for the model {model!r}.", f"Known: {', '.join(sorted(known))}."
        )
    return known[model]
