"""A plant: what a machine is, as data.

Axes (shafts and carriages) are driven by actuators, joined by transmissions and read by sensors.
Which equations of motion can be written follows from it, see `estimation.plant_equations`. Channels
are SI, and their names end in the unit.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Literal

from estimation.channels import UnknownUnitError, unit_of
from estimation.errors import EstimationError, nearest
from estimation.signals import Combination, Samples
from estimation.toml_table import Place

Reads = Literal["other", "position", "speed", "effort", "temperature", "reference"]

POSITION = {"rad": "_angle_rad", "m": "_position_m"}
SPEED = {"rad": "_velocity_rad_s", "m": "_velocity_m_s"}
ACCELERATION = {"rad": "_acceleration_rad_s2", "m": "_acceleration_m_s2"}
EFFORT = {"rad": "N m", "m": "N"}
"""Unit of an axis' travel to the ending of its channels, and to the unit of what drives it."""


class PlantError(EstimationError):
    """The parts of a machine do not fit together.

    Attributes:
        place: The part and its key as they are called in a machine file.
    """

    def __init__(self, place: Place, what: str, why: str = "", fix: str = "") -> None:
        self.place = place
        super().__init__(what, why, fix)


@dataclass(frozen=True)
class Axis:
    """A shaft or a carriage.

    Attributes:
        unit: `rad` of a shaft, `m` of a carriage.
        rest_speed: Speed below which it is at rest, in its unit a second; None where one count of
            its sensor in a period of the filter decides.
    """

    name: str
    unit: str
    rest_speed: float | None = None
    description: str = ""


@dataclass(frozen=True)
class Transmission:
    """What joins two axes.

    Attributes:
        name: Its name, also of the equation of what it loses.
        input: Axis on the side of the drive.
        ratio: Travel of the input per travel of the output, negative where it reverses the
            direction; None where it is fitted.
        compliant: Whether it bends measurably.
        damped: Whether the bend lags behind the load.
        deflection: Name of the equation of its bend.
    """

    name: str
    input: str
    output: str
    ratio: float | None = None
    compliant: bool = False
    damped: bool = False
    deflection: str = ""
    description: str = ""


@dataclass(frozen=True)
class Actuator:
    """What drives an axis.

    Attributes:
        name: Channel of the drive: a current, a voltage, a share of full scale, a force or torque.
    """

    name: str
    axis: str
    description: str = ""


@dataclass(frozen=True)
class Sensor:
    """What is measured.

    Attributes:
        axis: Axis it reads; empty where it is of none.
        reads: What it reads. An effort is what the axis passes on.
        counts: Counts in one unit of the channel, such as a radian; None where it is not known.
        rate_hz: Samples a second; None where it is not known.
        noise: Standard deviation in the unit of the channel; None where it is not known.
        delay_s: Age of a value when it is recorded; None where it is not known.
    """

    name: str
    axis: str = ""
    reads: Reads = "other"
    counts: float | None = None
    rate_hz: float | None = None
    noise: float | None = None
    delay_s: float | None = None
    description: str = ""

    @property
    def step(self) -> float | None:
        """One count, in the unit of the channel."""
        return None if self.counts is None else 1.0 / self.counts


@dataclass(frozen=True)
class Load:
    """A known force or torque that an axis carries, such as the weight of a pendulum.

    Its name is that of a channel, recorded or computed when a recording is read.
    """

    name: str
    axis: str
    description: str = ""


@dataclass(frozen=True)
class Part:
    """One effect of an equation.

    Attributes:
        id: Id of the effect in the catalogue.
        sign: Its side: 1 adds to the target, -1 subtracts from it.
        channels: Role to channel; the effect's default where a role is left out.
    """

    id: str
    sign: int = 1
    channels: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Written:
    """An equation as it is written down: a target and its effects.

    Attributes:
        samples: Which samples count; None for what suits the effects.
    """

    name: str
    target: str
    parts: tuple[Part, ...]
    description: str = ""
    samples: Samples | None = None


@dataclass(frozen=True)
class Plant:
    """A machine.

    Attributes:
        axes: Shafts and carriages.
        transmissions: What joins them.
        actuators: What drives them.
        sensors: What is measured.
        loads: Known weights.
        equations: Equations of its owner's, in addition to those that follow.
        derived: Derived channels of its owner's, in addition.
        cutoff_hz: Cutoff of the filter of every channel.
        order: Order of that filter.
        run_offsets: Whether an offset of each run is a nuisance of a fit.

    Raises:
        PlantError: The parts do not fit together.
    """

    name: str
    axes: tuple[Axis, ...] = ()
    transmissions: tuple[Transmission, ...] = ()
    actuators: tuple[Actuator, ...] = ()
    sensors: tuple[Sensor, ...] = ()
    loads: tuple[Load, ...] = ()
    equations: tuple[Written, ...] = ()
    derived: tuple[Combination, ...] = ()
    description: str = ""
    cutoff_hz: float = 50.0
    order: int = 3
    run_offsets: bool = True

    def __post_init__(self) -> None:
        _check_filter(self)
        _check_names(self)
        _check_axes(self)
        for number, sensor in enumerate(self.sensors, start=1):
            _check_sensor(self, sensor, ("sensor", number, ""))
        for number, joint in enumerate(self.transmissions, start=1):
            _check_transmission(joint, ("transmission", number, ""))
        for number, load in enumerate(self.loads, start=1):
            if unit_of(load.name) != EFFORT[self.axis(load.axis).unit]:
                raise PlantError(
                    ("load", number, "name"),
                    f"The load {load.name!r} is not in {EFFORT[self.axis(load.axis).unit]}.",
                    f"It acts on the axis {load.axis!r}.",
                    "Name it, for example, weight_n_m.",
                )

    def axis(self, name: str) -> Axis:
        """Return the axis of that name."""
        return next(axis for axis in self.axes if axis.name == name)

    def position(self, axis: str) -> Sensor | None:
        """Return the first sensor of an axis' position, or None."""
        return next((s for s in self.sensors if (s.axis, s.reads) == (axis, "position")), None)

    def speed(self, axis: str) -> Sensor | None:
        """Return the first sensor of an axis' speed, or None."""
        return next((s for s in self.sensors if (s.axis, s.reads) == (axis, "speed")), None)

    def effort(self, axis: str) -> Sensor | None:
        """Return the first sensor of what an axis passes on, or None."""
        return next((s for s in self.sensors if (s.axis, s.reads) == (axis, "effort")), None)

    def moved(self, axis: str, ending: Mapping[str, str]) -> str:
        """Return a channel of an axis' motion; empty where neither position nor speed is read."""
        unit = self.axis(axis).unit
        if (position := self.position(axis)) is not None:
            return position.name.removesuffix(POSITION[unit]) + ending[unit]
        speed = self.speed(axis)
        return speed.name.removesuffix(SPEED[unit]) + ending[unit] if speed else ""


def _check_filter(plant: Plant) -> None:
    """Refuse a filter that suits no sample rate; that of recordings is compared when they are."""
    if not 0 < plant.cutoff_hz < math.inf:
        raise PlantError(
            ("machine", 1, "cutoff_hz"),
            f"cutoff_hz = {plant.cutoff_hz:g} is not a cutoff.",
            "It must lie between 0 and half the sample rate, Hz.",
            "Omit it for 50 Hz.",
        )
    if plant.order < 1:
        raise PlantError(
            ("machine", 1, "order"),
            f"order = {plant.order} is not the order of a filter.",
            fix="Write 1 or more; omit it for 3.",
        )


def _check_names(plant: Plant) -> None:
    for table, names in (
        ("axis", [axis.name for axis in plant.axes]),
        ("transmission", [joint.name for joint in plant.transmissions]),
        ("equation", [equation.name for equation in plant.equations]),
    ):
        for number, name in enumerate(names, start=1):
            if name in names[: number - 1]:
                what = f"There are two of the name {name!r}."
                raise PlantError((table, number, "name"), what, fix="Rename one.")
    seen: set[str] = set()
    for table, names in (
        ("actuator", [actuator.name for actuator in plant.actuators]),
        ("sensor", [sensor.name for sensor in plant.sensors]),
        ("load", [load.name for load in plant.loads]),
        ("derived", [combination.name for combination in plant.derived]),
    ):
        for number, name in enumerate(names, start=1):
            place = (table, number, "name")
            try:
                unit_of(name)
            except UnknownUnitError as error:
                raise PlantError(place, error.what, error.why, error.fix) from error
            if name in seen:
                raise PlantError(place, f"Two channels are called {name!r}.", fix="Rename one.")
            seen.add(name)


def _check_axes(plant: Plant) -> None:
    names = [axis.name for axis in plant.axes]
    for number, axis in enumerate(plant.axes, start=1):
        if axis.unit not in POSITION:
            raise PlantError(
                ("axis", number, "unit"),
                f"The axis {axis.name!r} has the unit {axis.unit!r}.",
                "A shaft turns by rad, a carriage moves by m.",
                'Write unit = "rad" or unit = "m".',
            )
    for place, axis_name in _named_axes(plant):
        if axis_name not in names:
            fix = nearest(axis_name, names) if names else "Add an [[axis]] to the file."
            raise PlantError(place, f"There is no axis {axis_name!r}.", fix=fix)


def _named_axes(plant: Plant) -> Iterable[tuple[Place, str]]:
    for number, joint in enumerate(plant.transmissions, start=1):
        yield ("transmission", number, "input"), joint.input
        yield ("transmission", number, "output"), joint.output
    for number, actuator in enumerate(plant.actuators, start=1):
        yield ("actuator", number, "axis"), actuator.axis
    for number, sensor in enumerate(plant.sensors, start=1):
        if sensor.axis or sensor.reads in ("position", "speed", "effort"):
            yield ("sensor", number, "axis"), sensor.axis
    for number, load in enumerate(plant.loads, start=1):
        yield ("load", number, "axis"), load.axis


def _check_sensor(plant: Plant, sensor: Sensor, place: Place) -> None:
    for key in ("counts", "rate_hz", "noise", "delay_s"):
        value = getattr(sensor, key)
        if value is not None and (value < 0.0 or (value == 0.0 and key in ("counts", "rate_hz"))):
            least = "more than 0" if key in ("counts", "rate_hz") else "0 or more"
            raise PlantError(
                (*place[:2], key),
                f"The sensor {sensor.name!r} has {key} = {value:g}.",
                f"It is {least}.",
                f"Write {key} = NUMBER, or delete the line.",
            )
    if sensor.reads not in ("position", "speed", "effort"):
        return
    axis = plant.axis(sensor.axis)
    if sensor.reads == "effort":
        suits = unit_of(sensor.name) == EFFORT[axis.unit]
        wanted = f"ends in {'_n_m' if axis.unit == 'rad' else '_n'}"
    else:
        ending = (POSITION if sensor.reads == "position" else SPEED)[axis.unit]
        suits, wanted = sensor.name.endswith(ending), f"ends in {ending}"
    if not suits:
        raise PlantError(
            (*place[:2], "name"),
            f"The channel {sensor.name!r} cannot be the {sensor.reads} of the axis {axis.name!r}.",
            f"The axis is in {axis.unit}: the name of its {sensor.reads} {wanted}.",
            "Rename the channel, or change the axis, its unit or `reads`.",
        )


def _check_transmission(joint: Transmission, place: Place) -> None:
    if joint.input == joint.output:
        raise PlantError(
            (*place[:2], "output"), f"{joint.name!r} joins the axis {joint.input!r} to itself."
        )
    if joint.ratio == 0.0:
        raise PlantError(
            (*place[:2], "ratio"),
            f"The ratio of {joint.name!r} is zero.",
            fix="State the travel of the input per travel of the output, or none to fit it.",
        )
