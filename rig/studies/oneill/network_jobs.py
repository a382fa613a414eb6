"""What networks are trained on the data of O'Neill et al. 2018: the paper's rows, and states."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from rig.studies.oneill.data import CAUSAL
from rig.studies.oneill.paper import DISTAL, JAW, POSES, PROXIMAL, SURROGATES, TARGETS

BASE = ("spindle_angle_rad", "spindle_velocity_rad_s")

LOADS = {
    **{name: (channel,) for name, channel in SURROGATES.items()},
    "all": tuple(SURROGATES.values()),
    "sensor": (PROXIMAL,),
}
"""Channels of each surrogate of the paper's tables."""

ACCELERATION, TRAVEL = "motor_acceleration_rad_s2", "motor_travel_rad"

CHANNELS = (*BASE, *SURROGATES.values(), PROXIMAL, DISTAL, JAW, ACCELERATION, TRAVEL)

STATE_NODES = 12

MOTOR = [("end-to-end", "command"), ("end-to-end", "current")]
"""The rows of the paper that the physical states are compared with."""


@dataclass(frozen=True)
class Job:
    """One kind of network under one protocol: a row or two of a table."""

    pose: str  # key of `POSES`
    # `end-to-end` or `staged` as in the paper; `+ acceleration`, `+ travel` for networks with
    # physical states, and `causal` for the last of them on channels filtered as live
    way: str
    surrogate: str  # key of `LOADS`
    protocol: str  # as for `held_out_masks`
    targets: tuple[str, ...]

    @property
    def inputs(self) -> tuple[str, ...]:
        """Columns the network reads."""
        states = {"+ acceleration": (ACCELERATION,), "end-to-end": ()}
        own = states.get(self.way, (ACCELERATION, TRAVEL))
        channels = (*BASE, *LOADS[self.surrogate], *own)
        if self.way == "causal":
            channels = tuple(CAUSAL + name for name in channels)
        return (*channels, *filter(None, [POSES[self.pose]]))

    @property
    def nodes(self) -> int:
        """Hidden nodes: the paper's 30, fewer with more informative inputs."""
        return 30 if self.way in ("end-to-end", "staged") else STATE_NODES

    @property
    def stages(self) -> tuple["Job", ...]:
        """The networks of a job; of a staged one surrogate to torque, and torque to the targets."""
        if self.way != "staged":
            return (self,)
        first = replace(self, way="end-to-end", targets=(PROXIMAL,))
        return first, replace(self, way="end-to-end", surrogate="sensor")


Kind = tuple[str, str, str, tuple[str, ...]]
"""Pose, way, surrogate and targets of a job."""


def jobs(poses: tuple[str, ...]) -> list[Job]:
    """Return the rows of the study, the most telling ones first."""
    both = (DISTAL, JAW)
    paper: list[Kind] = [("neutral", "end-to-end", s, (PROXIMAL,)) for s in tuple(LOADS)[:4]]
    paper += [("neutral", "end-to-end", s, both) for s in LOADS]
    paper += [("neutral", "staged", s, both) for s in tuple(LOADS)[:4]]
    posed = [(p, "end-to-end", s, both) for p in ("pitch", "roll") for s in LOADS]
    ways = {
        way: [("neutral", way, s, (t,)) for s in ("command", "current") for t in TARGETS]
        for way in ("+ travel", "causal", "+ acceleration")
    }
    motor = _motor(paper)
    rest = [kind for kind in paper if kind not in motor]
    posed_states = [(p, "+ travel", "command", (t,)) for p in ("pitch", "roll") for t in both]
    order: list[tuple[str, Sequence[Kind]]] = [
        ("random", paper),
        *(
            ("run-wise", [kind for kind in [*ways["+ travel"], *motor] if kind[2] == surrogate])
            for surrogate in ("command", "current")
        ),
        ("lofo", ways["+ travel"]),
        ("lopo", ways["+ travel"]),
        ("run-wise", [*ways["causal"], *ways["+ acceleration"]]),
        ("lofo", motor),
        ("lopo", motor),
        ("random", posed),
        ("run-wise", _motor(posed)),
        ("run-wise", [*rest, *posed, *posed_states]),
        *((p, rest) for p in ("lofo", "lopo")),
        ("lopo", posed),
        *((p, ways["causal"]) for p in ("lofo", "lopo")),
    ]
    planned = [
        Job(pose, way, surrogate, protocol, targets)
        for protocol, kinds in order
        for pose, way, surrogate, targets in kinds
        if pose in poses
    ]
    return list(dict.fromkeys(planned))


def _motor(kinds: Sequence[Kind]) -> list[Kind]:
    return [kind for kind in kinds if kind[1:3] in MOTOR]
