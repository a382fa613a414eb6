"""Options of the display of a stream."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from rig.errors import UsageError
from rig.live.keys import DisplayKeys


@dataclass(frozen=True, slots=True)
class ShowOptions:
    """Options of a display.

    Raises:
        UsageError: The lever arm is not a positive length.
    """

    title: str
    channels: tuple[str, ...] = ("distal_torque_n_m",)  # quantities to watch, the main one first
    devices: tuple[str, ...] = ()  # further devices whose channels are shown too
    lever_m: float = 0.012  # lever arm from the jaw's axis to its tip; 12 mm in O'Neill et al. 2018
    plain: bool = False  # lines for people, also in a terminal that could draw
    json: bool = False  # one JSON object a line on stdout, nothing for people
    # returns half of the 95 % interval of each channel's newest estimate, SI
    half_widths: Callable[[], Mapping[str, float]] = dict
    footer: str = "Ctrl-C quits"
    help: str = ""
    keys: DisplayKeys | None = None

    def __post_init__(self) -> None:
        if not 0 < self.lever_m < math.inf:
            raise UsageError(
                f"A lever arm of {self.lever_m * 1e3:g} mm gives no force.",
                "The force at the jaw tip is the torque over the lever arm.",
                "Give a positive --lever-mm, for example 12.",
            )

    def with_keys(
        self, keys: DisplayKeys | None, words: Mapping[str, tuple[str, str]]
    ) -> "ShowOptions":
        """Return the options of a display with keys, each with its word and what it does."""
        if keys is None:
            return self
        does = (f"{key:>5}  {what}" for key, (_, what) in words.items())
        return replace(self, footer=in_a_line(words), help="\n".join(does), keys=keys)


def in_a_line(keys: Mapping[str, tuple[str, str]]) -> str:
    """Return keys with their words."""
    return "  ".join(f"{key} {word}" for key, (word, _) in keys.items())
