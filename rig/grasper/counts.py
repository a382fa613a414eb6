"""The stream of the 3-DOF grasper's raw counts in a log."""

from rig.log.schema import Field, Stream
from rig.log.streams import COUNTS

RATE_HZ = 2000.0
_AXES = ((1, "yaw"), (2, "jaw 1"), (3, "jaw 2"))

GRASPER_COUNTS = Stream(
    COUNTS,
    "rig_msgs/msg/GrasperCounts",
    (
        *(Field(f"motor_{k}", "int32", "", f"encoder of the motor of {a}") for k, a in _AXES),
        *(Field(f"target_{k}", "int32", "", f"target of {a}, counts") for k, a in _AXES),
        *(Field(f"current_{k}", "int32", "", f"measured current of {a}") for k, a in _AXES),
        *(Field(f"force_{k}", "int32", "", f"force sensor of {a}") for k, a in _AXES),
        *(Field(f"command_{k}_e4", "int32", "", f"command to {a}, 1e-4 of full") for k, a in _AXES),
        Field("sequence", "uint32", "", "number of the sample since the stream began"),
        Field("tick_us", "uint32", "", "device clock as sent, wraps at 2^32"),
        Field("status", "uint32", "", "status bits of the logger"),
    ),
    RATE_HZ,
)
"""The grasper's raw counts; all rise on closing."""
