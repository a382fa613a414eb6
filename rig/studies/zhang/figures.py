"""The study of Zhang et al. 2022 as figures."""

from pathlib import Path

import numpy as np

from rig.output.figures import bars, over_time, write_svgs
from rig.studies.zhang.free import NETWORKS, OURS
from rig.studies.zhang.page import JOINTS, OTHERS
from rig.studies.zhang.study import ZhangStudy

TRACES = {
    "grasp": "Grip force of grasping and letting go, first arm",
    "contact": "Force along the tip's y axis in contact, first arm",
    "held": "Grip force in contact, first arm",
}


def write_figures(folder: Path, study: ZhangStudy) -> list[Path]:
    """Write how joints and instruments do, and the first arm's grasp and contact over time."""
    networks = study.median(f"I | M+C on M | {NETWORKS}")
    ours = study.median(f"I | M+C on M | {OURS}")
    joints = {
        f"{joint} {who}": float(value)
        for k, joint in enumerate(JOINTS)
        for who, value in (("networks", networks[k]), ("ours", ours[k]))
    }
    instruments = {
        f"{name} {when}": float(study.median(f"II {when} | {name} | {NETWORKS}")[0])
        for name in OTHERS
        for when in ("before", "after")
    }
    traces = {name: np.array(values) for name, values in study.traces.items()}
    drawn = {
        **{
            f"zhang-{name}": over_time(
                traces[f"{name} | time, s"],
                {who: traces[f"{name} | {who}"] for who in ("sensor", NETWORKS, OURS)},
                "N",
                caption,
            )
            for name, caption in TRACES.items()
        },
        "zhang-joints": bars(joints, "NRMSE, %", "Free-space torque, gripper moving"),
        "zhang-instruments": bars(instruments, "NRMSE, %", "Gripper torque, networks' transfer"),
    }
    return write_svgs(folder, drawn)
