"""What a machine's channels give besides their readings: combinations, and speeds of standstill."""

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from functools import cache
from typing import Literal

from estimation.toml_table import Table, entries

Samples = Literal["all", "motion", "closing"]
"""Which samples of a run count: all valid ones, those in motion, or those that close the jaw."""


@dataclass(frozen=True)
class Share:
    """What a channel adds to a combination: value x times / over, such as a gear ratio.

    The channel is a measured one, a derivative of one, or another combination.
    """

    channel: str
    times: float = 1.0
    over: float = 1.0

    @property
    def gain(self) -> float:
        """Change of the combination per change of the channel."""
        return self.times / self.over


@dataclass(frozen=True)
class Direction:
    """A constant with the sign of a speed in a combination: size x tanh(speed / width).

    The speed is the name of a channel; the size is in the unit of the combination.
    """

    speed: str
    size: float
    width: float


@dataclass(frozen=True)
class Combination:
    """A derived channel that is a weighted sum of others."""

    name: str  # channel name, ends in its unit
    shares: tuple[Share, ...]  # what is summed
    direction: Direction | None = None  # nominal Coulomb friction, or None

    def gain(self, measured: str) -> float:
        """Return the change of the combination per change of a measured channel."""
        return sum(share.gain for share in self.shares if share.channel == measured)


@dataclass(frozen=True)
class Reading:
    """What is stated of a sensor; None where nothing is."""

    noise: float | None = None  # standard deviation of its white noise, in the unit of the channel
    step: float | None = None  # one count, in the unit of the channel
    rate_hz: float | None = None  # new values a second
    delay_s: float | None = None  # age of a value when it is recorded

    def age_s(self, sample_rate_hz: float) -> float:
        """Return the mean age of a recorded value, s; a slower sensor's is held until the next."""
        held_s = 0.0 if self.rate_hz is None else 0.5 / self.rate_hz - 0.5 / sample_rate_hz
        return (self.delay_s or 0.0) + max(held_s, 0.0)


@dataclass(frozen=True)
class Signals:
    """The derived channels of a machine, when its parts are at rest, and its sensors."""

    combinations: tuple[Combination, ...] = ()  # derived channels
    # Channel of each speed that friction depends on, and the speed below which the part is at rest,
    # in the unit of the channel. While a gearbox winds up the motor turns and the spindle stands
    # still: an equation is static when the speed of its own friction is below the threshold. Slower
    # than a share of the usual speed is at rest too, see `estimation.rest`, so 0 is a threshold
    # that follows the data.
    rest: Mapping[str, float] = field(default_factory=dict)
    # what is stated of the sensors of some channels; of a temperature or a position that it is one
    readings: Mapping[str, Reading] = field(default_factory=dict)
    # Positions that follow from another's by the ratio of a transmission. One whose axis has no
    # encoder is among the combinations, too; else a reading can be compared with it.
    joined: tuple[Combination, ...] = ()
    # positions that no sensor reads, to the speeds that they are the integrals of
    integrals: Mapping[str, str] = field(default_factory=dict)
    # known forces and torques, which are no sensor's: a weight by a formula of the angle
    loads: tuple[str, ...] = ()
    # what drives the machine: a current, a voltage, or the force itself
    actuators: tuple[str, ...] = ()

    @property
    def temperatures(self) -> tuple[str, ...]:
        """Channels that the machine states to be temperatures, K."""
        return tuple(name for name in self.readings if name.endswith("_k"))

    def combination(self, name: str) -> Combination | None:
        """Return the combination of that name, or None where there is none."""
        return next((c for c in self.combinations if c.name == name), None)


@cache
def reference() -> Signals:
    """Return the signals of the reference rig, which a model file without signals is of."""
    from estimation.plant_equations import signals
    from estimation.plant_file import shipped_plant

    return signals(shipped_plant("reference"))


def read_combinations(tables: Iterable[Table]) -> tuple[Combination, ...]:
    """Read `[[derived]]` tables; what is unknown, missing or wrong is the tables' own error."""
    return tuple(_combination(table) for table in tables)


def _combination(table: Table) -> Combination:
    name = table.take("name", str)
    shares = []
    for share in table.tables("shares"):
        shares.append(share.made(Share))
        if shares[-1].over == 0.0:
            raise table.error(f"{table.at('shares')}: a channel cannot be divided by zero.")
    direction = None
    if "direction" in table.content:
        direction = table.table("direction").made(Direction)
    table.finish()
    return Combination(name, tuple(shares), direction)


def combination_lines(combinations: Iterable[Combination], header: str) -> list[str]:
    """Return combinations as TOML; `read_combinations` gives them back."""
    lines = []
    for one in combinations:
        shares = [{k: v for k, v in asdict(share).items() if v != 1.0} for share in one.shares]
        turn = None if one.direction is None else asdict(one.direction)
        lines += ["", f"[[{header}]]"]
        lines += entries({"name": one.name, "shares": shares, "direction": turn})
    return lines
