"""Machines that nobody has, drawn at random and handed over as a table and a machine file.

Kind, size, units, names, counts, noise, rates and motion are drawn over factors: a carriage or a
shaft with one encoder, or a transmission with two encoders and a torque cell. The machine is not
simulated forwards: a smooth motion is drawn, and the drive that it takes is worked out.
"""

import csv
import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.diagnosis import scoring
from benchmarks.diagnosis.case import BLOCK, MACHINE_FILE, Case, in_turn
from estimation.files import write_text_atomic
from estimation.recording import FloatArray

KINDS = ("strong", "weak", "outside", "clean")
SIZES = {"strong": (6.0, 15.0), "weak": (2.0, 4.0), "outside": (6.0, 15.0), "clean": (0.0, 0.0)}
"""Size of the hidden effect within runs, times the noise of what it shows in."""

CUTOFF_HZ = 50.0
"""Of the filter of a machine file."""

MACHINE = """schema = "rig.machine/1"

[machine]
name = "drawn"
run_offsets = {offsets}

[[axis]]
name = "{axis}"
unit = "{unit}"

[[actuator]]
name = "{drive}"
axis = "{axis}"

[[sensor]]
name = "{position}"
axis = "{axis}"
reads = "position"

[data]
files = "*.csv"

[data.runs]
changes = ["run"]

[data.columns]
time_s = "t"
{drive} = "u:{drive_unit}"
{position} = "x:{position_unit}"
"""

GEAR = """{other}_angle_rad = "y:deg"
{other}_torque_n_m = "cell:N m"

[[axis]]
name = "{other}"
unit = "rad"

[[transmission]]
name = "{joint}"
input = "{axis}"
output = "{other}"
ratio = {ratio!r}
compliant = true

[[sensor]]
name = "{other}_angle_rad"
axis = "{other}"
reads = "position"

[[sensor]]
name = "{other}_torque_n_m"
axis = "{other}"
reads = "effort"
"""
"""What a transmission adds behind the columns of a single axis."""

COLUMNS = ("run", "t", "u", "x", "y", "cell")
AXES = ("table", "ram", "gantry", "wheel", "elbow", "drum", "stage", "shaft")
OTHERS = ("link", "output", "arm", "head")
JOINTS = ("belt", "gear", "harmonic", "reducer")
DEGREES = 180.0 / np.pi
UNITS = {"m": {"mm": 1e3, "m": 1.0}, "rad": {"deg": DEGREES, "rad": 1.0}}
DRIVES = {"current_a": {"A": 1.0, "mA": 1e3}, "voltage_v": {"V": 1.0}, "pwm_ratio": {"1": 1.0}}


@dataclass(frozen=True)
class Run:
    """One run, without its hidden effect."""

    number: int
    time_s: FloatArray  # From its first sample
    age_s: FloatArray  # Time since the campaign began
    position: FloatArray  # Of the driven axis
    speed: FloatArray  # Of it
    load: FloatArray  # Torque of the output; zero without one
    other: FloatArray  # Angle of the output; zero without one


Form = Callable[["Scale", Run], FloatArray]


@dataclass(frozen=True)
class Effect:
    """A hidden effect.

    Attributes:
        families: Its family, and those that no sensor of such a machine distinguishes from it.
        form: Its course in a run, of any size.
        variables: Groups of words for what no catalogue holds.
        enters: What it adds to: the `loss` of the drive, the `bend`, or the reading `x`, `y` or
            `cell`.
        of_gear: Whether it needs a transmission with a torque cell.
        of_single: Whether it is hidden in a single axis, if it enters the loss.
    """

    families: tuple[str, ...]
    form: Form
    variables: tuple[str, ...] = ()
    enters: str = "loss"
    of_gear: bool = True
    of_single: bool = True

    def fits(self, geared: bool) -> bool:
        """Whether it is hidden in machines with a transmission, or in those without."""
        return self.of_gear if geared else self.of_single and self.enters == "loss"


@dataclass(frozen=True)
class Scale:
    """Sizes of a machine, as its forms need them."""

    travel: float  # Of the driven axis
    speed: float  # Usual most speed of it
    width: float  # Speed over which friction changes its sign
    load: float  # Usual most torque of the output
    seconds: float  # Length of a run
    last_s: float  # Age at the end of the campaign
    runs: int  # How many
    turns: bool  # Whether the driven axis is a shaft
    fastest_hz: float  # Most periods of its motion a second
    rate_hz: float  # Samples a second
    ratio: float  # Of its transmission; 0 without one
    drawn: FloatArray  # Numbers between 0 and 1 that the forms choose their shapes by


def _signed(scale: Scale, run: Run) -> FloatArray:
    return np.tanh(run.speed / scale.width)


def _between(scale: Scale, k: int, low: float, high: float) -> float:
    return float(low * (high / low) ** scale.drawn[k])


def _stribeck(scale: Scale, run: Run) -> FloatArray:
    fall = _between(scale, 0, 0.08, 0.3) * scale.speed
    return np.exp(-((np.abs(run.speed) / fall) ** (1.0 + scale.drawn[1]))) * _signed(scale, run)


def _wave(scale: Scale, run: Run) -> FloatArray:
    order = 2.0 * np.pi / scale.travel * _between(scale, 0, 5.0, 25.0)
    if scale.turns:  # a whole number of times a turn
        order = max(1.0, round(order)) if order > 1.5 else np.ceil(7.0 * scale.drawn[0])
    return np.sin(order * run.position + 6.0 * scale.drawn[1])


def _spot(scale: Scale, run: Run) -> FloatArray:
    place = (scale.drawn[0] - 0.5) * 0.6 * scale.travel
    wide = _between(scale, 1, 0.04, 0.1) * scale.travel
    return np.exp(-0.5 * ((run.position - place) / wide) ** 2)


def _hump(scale: Scale, run: Run) -> FloatArray:
    pace = _between(scale, 0, 0.3, 0.6) * scale.speed
    return np.exp(-((5.0 * (np.abs(run.speed) / pace - 1.0)) ** 2))


def _step(scale: Scale, run: Run) -> FloatArray:
    later = run.number >= round(scale.runs * (0.35 + 0.3 * scale.drawn[0]))
    return float(later) * _signed(scale, run)


def _fading(scale: Scale, run: Run) -> FloatArray:
    time = _between(scale, 0, 0.15, 0.5) * scale.last_s
    return np.exp(-run.age_s / time) * _signed(scale, run)


def _presliding(scale: Scale, run: Run) -> FloatArray:
    reach = _between(scale, 0, 0.01, 0.05) * scale.travel
    state, out = 0.0, np.zeros(len(run.position))
    for k, change in enumerate(np.diff(run.position, prepend=run.position[0])):
        state = min(max(state + change, -reach), reach)
        out[k] = state
    return out / reach - _signed(scale, run)


LOOPS = ("hysteresis.presliding", "hysteresis.bouc_wen")
SPRINGS = ("spring.position", "gravity.payload", "spring.end_stop")
RUBS = ("friction.load", "friction.capstan")
WAVES = ("ripple.motor", "ripple.output")

NAMED = {
    "stribeck": Effect(("friction.stribeck",), _stribeck),
    "asymmetry": Effect(
        ("friction.viscous_asymmetry",), lambda _, run: np.abs(run.speed), of_gear=False
    ),
    "drag": Effect(("friction.drag",), lambda _, run: run.speed * np.abs(run.speed)),
    "cogging": Effect(WAVES, _wave),
    "spring": Effect(SPRINGS, lambda _, run: run.position, of_gear=False),
    "step": Effect(("change.step", "friction.coulomb"), _step),
    "fading": Effect(("friction.warmup",), _fading),
    "presliding": Effect(LOOPS, _presliding),
    "load friction": Effect(
        RUBS, lambda s, run: np.abs(run.load) * _signed(s, run), of_single=False
    ),
    "backlash": Effect(
        ("transmission.backlash",),
        lambda s, run: np.tanh(run.load / (0.03 * s.load)),
        enters="bend",
    ),
    "stiffening": Effect(
        ("transmission.stiffening",), lambda _, run: -run.load * np.abs(run.load), enters="bend"
    ),
    "shaped gear": Effect(("ripple.output", "sensor.encoder_inl"), _wave, enters="bend"),
    "input encoder": Effect(("sensor.encoder_inl",), _wave, enters="x"),
    "cell": Effect(
        ("sensor.gain_nonlinear",), lambda _, run: run.load * np.abs(run.load), enters="cell"
    ),
    "late cell": Effect(
        ("sensor.delay", "sensor.lag"),
        lambda s, run: -np.gradient(run.load, run.time_s) * 1e-3 * s.seconds,
        enters="cell",
    ),
}

UNNAMED = {
    "tight spot": Effect(
        ("unknown",),
        lambda s, run: _spot(s, run) * _signed(s, run),
        ("velocity_sign velocity", "position"),
    ),
    "notch": Effect(("unknown",), _spot, ("position",)),
    "rough speed": Effect(
        ("unknown",),
        lambda s, run: _hump(s, run) * _signed(s, run),
        ("velocity_sign velocity",),
    ),
}


def is_geared(random: np.random.Generator) -> bool:
    """Draw whether a machine has a transmission and a torque cell."""
    return bool(random.random() < 0.45)


def _drawn_effect(kind: str, geared: bool, random: np.random.Generator) -> Effect | None:
    """Draw an effect to hide; None in a clean case."""
    every = UNNAMED if kind == "outside" else NAMED
    fitting = [effect for effect in every.values() if effect.fits(geared)]
    effect = fitting[int(random.integers(len(fitting)))]
    return None if kind == "clean" else effect


def cases(seed: int, counts: Mapping[str, int], kept: Path) -> Iterator[Case]:
    """Yield the cases of a block of seeds, the classes in turn; answers are kept in a folder."""
    most = {kind: min(count, BLOCK) for kind, count in counts.items()}
    return in_turn(KINDS, most, lambda kind, k: _case(kind, seed + k, kept))


def _case(kind: str, seed: int, folder_of_answers: Path) -> Case:
    name = f"stranger-{kind}-{seed}"
    kept = folder_of_answers / f"{name}.json"

    def write(folder: Path) -> None:
        write_text_atomic(kept, json.dumps(draw(seed, kind, folder)))

    def judge(report: Mapping[str, object]) -> scoring.Judgement:
        content = json.loads(kept.read_text())
        hidden = [scoring.Hidden(*effect) for effect in content]
        return scoring.judge(scoring.Truth(kind, hidden, ()), report)

    options = ("--machine", f"{{case}}/{MACHINE_FILE}")
    return Case(name, kind, write, judge, options=options)


def draw(seed: int, kind: str, folder: Path) -> list[list[list[object]]]:
    """Draw a machine, write its table and its file into a folder, and return the hidden effects.

    Returns:
        Families, equations and groups of variables of each, as `scoring.Hidden` takes them.
    """
    random = np.random.default_rng([seed, KINDS.index(kind), 7])
    geared = is_geared(random)
    chosen = _drawn_effect(kind, geared, random)
    axis, other, joint = (str(random.choice(words)) for words in (AXES, OTHERS, JOINTS))
    unit = "rad" if geared or random.random() < 0.5 else "m"
    over = partial(_over, random)
    travel = over(0.02, 2.0) if unit == "m" else over(0.5, 60.0)
    ratio = round(over(3.0, 120.0), 3)
    runs, rate_hz, seconds = int(random.integers(9, 15)), over(200.0, 1500.0), over(5.0, 10.0)
    fastest_hz = over(0.3, 1.2)
    if geared:
        travel = ratio * over(0.4, 4.0)
    speed = np.pi * fastest_hz * travel * 0.6
    scale = Scale(
        travel, speed, speed * over(0.01, 0.03), over(0.3, 50.0), seconds, runs * seconds, runs,
        unit == "rad", fastest_hz, rate_hz, ratio if geared else 0.0, random.random(4),
    )  # fmt: skip
    friction = over(0.01, 100.0) if not geared else scale.load / ratio * over(0.05, 0.5)
    inertia = friction * over(0.2, 3.0) / (speed * 2.0 * np.pi * fastest_hz)
    viscous, gain = friction * over(0.2, 1.5) / speed, friction * over(0.2, 20.0)
    noise = friction * over(0.004, 0.02) if not geared else scale.load / ratio * over(0.002, 0.01)
    cell_noise, stiffness = scale.load * over(0.001, 0.005), scale.load / over(0.002, 0.02)
    counts = travel / over(1e5, 1e7)
    made = [_run(k, scale, stiffness, random) for k in range(runs)]
    seen = np.sqrt(2.0 * CUTOFF_HZ / rate_hz)  # share of white noise that the filter passes
    jitter = inertia * _jitter(made[0].position, counts, rate_hz)
    loss = seen * np.hypot(noise, cell_noise / ratio if geared else 0.0) + jitter
    bend = seen * ((0.3 / ratio + 0.03) * counts + cell_noise / stiffness)
    floor = {"loss": loss, "bend": bend, "x": ratio * bend, "cell": ratio * loss}
    hidden = _hidden(chosen, scale, made, floor, over(*SIZES[kind]) if chosen else 0.0)
    rows = []
    for run, extra in zip(made, hidden, strict=True):
        position = run.position + ratio * extra["bend"]
        pace = np.gradient(position, run.time_s)
        loss = inertia * np.gradient(pace, run.time_s) + viscous * pace + extra["loss"]
        loss += friction * np.tanh(pace / scale.width) + (run.load / ratio if geared else 0.0)
        read = position + extra["x"]
        columns = [
            np.full(len(read), run.number),
            run.time_s,
            (loss + random.normal(0.0, noise, len(read))) / gain,
            np.round(read / counts) * counts,
        ]
        if geared:
            fine = 0.1 * counts
            cell = run.load + extra["cell"] + random.normal(0.0, cell_noise, len(read))
            columns += [np.round(run.other / fine) * fine * DEGREES, cell]
        rows.append(np.column_stack(columns))
    names = {"axis": axis, "other": other, "joint": joint, "ratio": ratio, "unit": unit}
    _hand_over(folder, names, np.concatenate(rows), random)
    if chosen is None:
        return []
    own = f"{axis}_{'position' if unit == 'm' else 'angle'}"
    place = {own, f"{other}_angle"} if geared else {own}
    groups = [sorted(place) if group == "position" else group.split() for group in chosen.variables]
    return [[list(chosen.families), [axis, joint] if geared else [axis], groups]]


def _hand_over(
    folder: Path, names: Mapping[str, object], table: FloatArray, random: np.random.Generator
) -> None:
    """Write the machine's file and its table, the drive and the position in drawn units."""
    axis, unit, geared = names["axis"], str(names["unit"]), table.shape[1] == len(COLUMNS)
    kind_of_drive = str(random.choice(list(DRIVES)))
    drive_unit, drive_scale = _choice(DRIVES[kind_of_drive], random)
    position_unit, position_scale = _choice(UNITS[unit], random)
    if kind_of_drive == "pwm_ratio":
        drive_scale /= float(1.2 * np.max(np.abs(table[:, 2])))
    table[:, 2] *= drive_scale
    table[:, 3] *= position_scale
    words = {
        **names,
        "drive": f"{axis}_{kind_of_drive}",
        "drive_unit": drive_unit,
        "position": f"{axis}_{'position_m' if unit == 'm' else 'angle_rad'}",
        "position_unit": position_unit,
        "offsets": "true" if geared else "false",
    }
    (folder / MACHINE_FILE).write_text((MACHINE + GEAR if geared else MACHINE).format(**words))
    with (folder / "table.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS[: table.shape[1]])
        writer.writerows([[f"{value:.10g}" for value in row] for row in table])


def _jitter(position: FloatArray, count: float, rate_hz: float) -> float:
    """Return the acceleration that an encoder's counts make, after the filter."""
    wrong = np.fft.rfft(np.round(position / count) * count - position)
    hz = np.fft.rfftfreq(len(position), 1.0 / rate_hz)
    return float(np.std(np.fft.irfft(wrong * (2 * np.pi * hz) ** 2 * (hz < CUTOFF_HZ))))


def _over(random: np.random.Generator, low: float, high: float) -> float:
    """Return a number drawn evenly over factors."""
    return float(low * (high / low) ** random.random())


def _choice(units: Mapping[str, float], random: np.random.Generator) -> tuple[str, float]:
    name = str(random.choice(list(units)))
    return name, units[name]


def _smooth(
    time_s: FloatArray, size: float, fastest_hz: float, random: np.random.Generator
) -> FloatArray:
    """Return a sum of five sines of a size, shape (n,)."""
    waves = [
        random.normal()
        / (k + 1)
        * np.sin(2 * np.pi * _over(random, 0.15, 1.0) * fastest_hz * time_s + random.uniform(0, 6))
        for k in range(5)
    ]
    whole = np.sum(waves, axis=0)
    return np.asarray(size * whole / np.max(np.abs(whole)))


def _run(k: int, scale: Scale, stiffness: float, random: np.random.Generator) -> Run:
    time_s = np.arange(0.0, scale.seconds, 1.0 / round(scale.rate_hz))
    size = 0.5 * scale.travel * random.uniform(0.6, 1.0)
    position = _smooth(time_s, size, scale.fastest_hz, random)
    load, other = np.zeros(len(time_s)), np.zeros(len(time_s))
    if scale.ratio:
        load = scale.load * (0.4 + 0.3 * (k % 3)) * _smooth(time_s, 1.0, scale.fastest_hz, random)
        other = position / scale.ratio
        position = position + scale.ratio * load / stiffness
    speed = np.gradient(position, time_s)
    return Run(k, time_s, k * scale.seconds + time_s, position, speed, load, other)


def _hidden(
    chosen: Effect | None,
    scale: Scale,
    runs: list[Run],
    floor: Mapping[str, float],
    size: float,
) -> list[dict[str, FloatArray]]:
    """Return the shares of the effect in the loss, the bend and the readings of each run."""
    out = [dict.fromkeys(floor, np.zeros(len(run.time_s))) for run in runs]
    if chosen is None:
        return out
    forms = [chosen.form(scale, run) for run in runs]
    level = np.sqrt(np.mean([float(np.mean((f - np.mean(f)) ** 2)) for f in forms]))
    for extra, form in zip(out, forms, strict=True):
        extra[chosen.enters] = size * floor[chosen.enters] * form / level
    return out
