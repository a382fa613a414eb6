"""The true structure of a case, fitted by its own optimiser: what a perfect diagnosis would leave.

The declared model with the hidden effects' own forms beside it, all parameters fitted together on
the runs that discovered, starting from the truth; its error on the confirm runs is over the same
samples as the one that a diagnosis reports.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy import optimize

from estimation import model_file
from estimation.campaign import Campaign
from estimation.diagnosis.balance import Balance, lay_out
from estimation.diagnosis.design import Run, prepare
from estimation.fitting import fit
from estimation.recording import FloatArray, Recording
from rig.simulation.fitted import DECLARED_PLANT
from rig.simulation.hidden import HiddenEffect, table
from rig.simulation.parameters import SensorParameters
from tests.blind.generate import APART_S, FADE_S, Answer
from tests.blind.true_forms import ADDED
from tests.blind.true_sensors import SHOWN, UNDONE
from tests.blind.truths import TRUTHS

CHANNELS = (
    "proximal_torque_n_m",
    "distal_torque_n_m",
    "proximal_torque_rate_n_m_s",
    "distal_torque_rate_n_m_s",
    "motor_current_a",
    "motor_angle_rad",
    "motor_velocity_rad_s",
    "motor_acceleration_rad_s2",
    "spindle_angle_rad",
    "spindle_velocity_rad_s",
    "spindle_acceleration_rad_s2",
    "jaw_angle_rad",
)
ZEROS = {
    "proximal_torque_n_m": SensorParameters().proximal_offset_n_m,
    "distal_torque_n_m": SensorParameters().distal_offset_n_m,
    "motor_current_a": SensorParameters().current_offset_a,
}
"""What the sensors show of nothing: a truth that is bent needs to know where nothing is."""

WIDTHS = {
    "motor": DECLARED_PLANT.motor_creep_speed_rad_s,
    "cable": DECLARED_PLANT.spindle_creep_speed_rad_s,
}
"""Width of the sign of the friction that is declared, the only shape there is, by balance."""

MOST_STEPS = 25
FAR = 5.0


def told(answer: Answer, balance: str) -> bool:
    """Say whether the channels of a balance tell all that is hidden in it."""
    model = model_file.read(Path(balance))
    return all(
        (effect.name, balance) in ADDED
        or (effect.name, model.target) in SHOWN
        or any((effect.name, channel) in UNDONE for channel in model.channels)
        for effect in answer.effects
        if balance in TRUTHS[effect.name].balances
    )


def true_rmse(
    answer: Answer, balance: str, recordings: Sequence[Recording], discover: Sequence[str]
) -> float:
    """Return the error on the confirm runs of the true structure fitted on the others.

    Args:
        answer: What is hidden.
        balance: Name of a shipped model.
        recordings: All runs of the case, in order.
        discover: Names of the runs to fit on.
    """
    declared = model_file.read(Path(balance))
    wanted = [*CHANNELS, *(["wrist_pitch_rad"] if answer.excitation == "wrist" else [])]
    runs = [
        prepare(r, [declared.target, *wanted, *declared.channels], declared) for r in recordings
    ]
    learnt = [k for k, run in enumerate(runs) if run.name in discover]
    start = fit(declared, Campaign.of(recordings[k] for k in learnt), bootstrap=0)
    whole = lay_out(start, [runs[k] for k in learnt])
    placed = list(enumerate(runs))
    truth = Structure(answer, whole)
    found = optimize.least_squares(
        lambda p: truth.left(p, [placed[k] for k in learnt]),
        truth.start,
        bounds=truth.bounds,
        x_scale=np.maximum(np.abs(truth.start), 1e-6),
        max_nfev=MOST_STEPS,
    )
    left = truth.left(found.x, [one for one in placed if one[0] not in learnt], report=True)
    return float(np.sqrt(np.mean(left**2)))


@dataclass(frozen=True)
class Structure:
    """A declared balance with the truth beside it.

    Its parameters: amplitudes of the declared terms, their shapes, then a row of each effect.

    Attributes:
        answer: What is hidden.
        whole: The declared balance, fitted.
    """

    answer: Answer
    whole: Balance

    @property
    def start(self) -> FloatArray:
        """The parameters to start from: the declared fit, and the truth."""
        widths = [WIDTHS[self.whole.model.balance] for term in self.whole.terms if term.shape]
        rows = [np.ravel(table([e])[table([e]).any(axis=1)]) for e in self.answer.effects]
        return np.concatenate([self.whole.solve(self.whole.terms), widths, *rows])

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Amplitudes are free; all else stays within a factor `FAR` of where it starts."""
        start = self.start
        ends = np.array([start / FAR, start * FAR])
        low, high = ends.min(axis=0) - 1e-9, ends.max(axis=0) + 1e-9
        free = sum(len(term.effect.amplitudes) for term in self.whole.terms)
        low[:free], high[:free] = -np.inf, np.inf
        return low, high

    def left(
        self, parameters: FloatArray, runs: Sequence[tuple[int, Run]], report: bool = False
    ) -> FloatArray:
        """Return what is left of some runs, each run's mean removed, runs one after another.

        Args:
            parameters: In the order of `start`.
            runs: Places and runs.
            report: Over all valid samples, as reported errors are; else at those of a fit.
        """
        parts = []
        for index, run in runs:
            error = run.channels[self.whole.model.target] - self._told(parameters, run, index)
            error = error[run.valid if report else run.kept]
            parts.append(error - error.mean())
        return np.concatenate(parts)

    def _told(self, parameters: FloatArray, run: Run, index: int) -> FloatArray:
        """Return the balance's target as the structure tells it, offset aside, shape (n,)."""
        model, terms = self.whole.model, list(self.whole.terms)
        count = sum(len(term.effect.amplitudes) for term in terms)
        weights, at, width = parameters[:count], count, 1.0
        for k, term in enumerate(terms):
            shape = parameters[at : at + len(term.shape)]
            at += len(term.shape)
            terms[k] = replace(term, shape=tuple(shape.tolist()))
            if term.family == "friction.coulomb":
                width = float(shape[0])
        effects = self._rows(parameters[at:], index)
        channels = dict(run.channels)
        for effect, row in effects:
            for name in model.channels:
                if (effect.name, name) in UNDONE and name != model.target:
                    zero = ZEROS.get(name, 0.0)
                    true = UNDONE[effect.name, name](run.channels, row, channels[name] - zero)
                    channels[name] = true + zero
        if channels["proximal_torque_n_m"] is not run.channels["proximal_torque_n_m"]:
            rate = np.gradient(channels["proximal_torque_n_m"], 1e-3)
            channels["proximal_torque_rate_n_m_s"] = rate
        total = np.column_stack([term.columns(channels) for term in terms]) @ weights
        channels |= {name: channels[name] - zero for name, zero in ZEROS.items()}
        for effect, row in effects:
            if (effect.name, model.balance) in ADDED:
                total = total + ADDED[effect.name, model.balance](channels, row, width)
        for effect, row in effects:
            if (effect.name, model.target) in SHOWN:
                total = SHOWN[effect.name, model.target](channels, row, total)
        return np.asarray(total)

    def _rows(self, numbers: FloatArray, index: int) -> list[tuple[HiddenEffect, FloatArray]]:
        """Return the effects that are in a run, each with its row."""
        if index not in self.answer.runs:
            return []
        rows = []
        for place, effect in enumerate(self.answer.effects):
            row = np.array(numbers[3 * place : 3 * place + 3])
            if TRUTHS[effect.name].course == "fades":
                row[0] /= 1.0 + index * APART_S / FADE_S
            rows.append((effect, row))
        return rows
