"""The tables of a configuration that depend on the machine, each machine's by an entry point."""

from dataclasses import dataclass
from functools import cache
from importlib.metadata import entry_points
from typing import Any, ClassVar

from pydantic import ConfigDict, Field, ValidationError, model_validator

from rig.configuration.sections import MACHINE_SETTINGS, Angle, Current, Positive, Section, Torque
from rig.errors import UsageError


class LimitsSection(Section):
    """Limits checked at every sample, on the absolute value; a crossing ends in the safe state.

    Every key is the name of a channel; which there are depends on `[logger] profile`. The channel
    of a further device is `NAME.channel`.
    """

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, Positive] = Field(init=False)

    takes_any: ClassVar[bool] = False
    """Whether a key may be any channel of the device in the logger's place."""

    @property
    def further(self) -> dict[str, float]:
        """Limits of channels that the machine does not name: only the devices know them."""
        return dict(self.__pydantic_extra__)

    @model_validator(mode="before")
    @classmethod
    def _is_a_channel(cls, value: Any) -> Any:
        """Take `NAME.channel` with and without quotes; refuse a key that no device can have."""
        if not isinstance(value, dict):
            return value
        flat: dict[str, Any] = {}
        for name, limit in value.items():
            inner = limit if isinstance(limit, dict) else {}
            flat |= {f"{name}.{channel}": one for channel, one in inner.items()} or {name: limit}
        strange = [
            {"type": "extra_forbidden", "loc": (name,), "input": limit}
            for name, limit in flat.items()
            if not (cls.takes_any or "." in name or name in cls.model_fields)
        ]
        if strange:
            raise ValidationError.from_exception_data(cls.__name__, strange)  # type: ignore[arg-type]
        return flat


class DriftSection(Section):
    """Largest change of a sensor's zero over a run that passes; without a limit none is judged."""


class OwnSection(Section):
    """What else a machine is configured by, the table `[machine]`; empty where nothing is."""


@dataclass(frozen=True)
class MachineSettings:
    """What a configuration may hold for one kind of machine.

    Attributes:
        limits: The table `[limits]`.
        drift: The table `[drift]`.
        drivers: Values of `[logger] driver` that can move and sample it; None for any driver.
        own: The table `[machine]`.
        moves: Whether it has motors, and so needs the table `[controller]`.
    """

    limits: type[LimitsSection]
    drift: type[DriftSection]
    drivers: tuple[str, ...] | None
    own: type[OwnSection] = OwnSection
    moves: bool = True


@cache  # the computer's packages are read through for every look
def installed(group: str, profile: str) -> Any:
    """Return the object in an entry point group for a profile.

    Raises:
        UsageError: None is installed, or it cannot be loaded.
    """
    found = entry_points(group=group, name=profile)
    if not found:
        known = ", ".join(sorted(entry.name for entry in entry_points(group=group)))
        raise UsageError(
            f"Nothing is installed for [logger] profile = {profile!r}.",
            f"The entry point group {group} has: {known or 'none'}.",
            "Install the project again (`pip install -e .`), or name another profile.",
        )
    entry = next(iter(found))
    try:
        return entry.load()
    except (ImportError, AttributeError) as error:
        raise UsageError(
            f"{entry.value} cannot be loaded: {error}.",
            f"It is installed for [logger] profile = {entry.name!r}.",
            "Install its package again, or remove it.",
        ) from error


def settings_of(profile: str) -> MachineSettings:
    """Return the settings of the machine that is installed under a name; as `installed`."""
    loaded = installed(MACHINE_SETTINGS, profile)
    if not isinstance(loaded, MachineSettings):
        raise UsageError(f"{profile}: a {type(loaded).__name__} is installed, not MachineSettings.")
    return loaded


class ReferenceLimits(LimitsSection):
    """Limits of the reference rig."""

    proximal_torque_n_m: Torque
    distal_torque_n_m: Torque
    motor_current_a: Current
    load_command_a: float = Field(ge=0, le=60)
    spindle_angle_rad: Angle


class ReferenceDrift(DriftSection):
    """Sensors of the reference rig whose zero drifts."""

    proximal_torque_n_m: Torque | None = None
    distal_torque_n_m: Torque | None = None
    motor_current_a: Current | None = None


REFERENCE = MachineSettings(ReferenceLimits, ReferenceDrift, ("teensy", "epos4"))


class SensorLimits(LimitsSection):
    """Limits of any channels of a device without motors."""

    takes_any = True


class DriveLimits(ReferenceLimits):
    """Limits of a drive, whose shaft counts as the spindle, and of any other of its channels."""

    takes_any = True

    proximal_torque_n_m: Torque = 100.0
    distal_torque_n_m: Torque = 100.0
    load_command_a: float = Field(default=0.0, ge=0, le=0)


DRIVE = MachineSettings(DriveLimits, ReferenceDrift, None)
SENSOR = MachineSettings(SensorLimits, DriftSection, None, moves=False)
