"""What a cause named in one balance makes of another: told once, and small echoes not at all."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from estimation import model_file
from estimation.campaign import Campaign
from estimation.diagnosis.balance import lay_out
from estimation.diagnosis.candidate import Candidate
from estimation.diagnosis.consequences import follows
from estimation.diagnosis.design import prepare
from estimation.diagnosis.frozen import Part, freeze
from estimation.diagnosis.naming import Discovery
from estimation.diagnosis.story import Claim, Story
from estimation.effects import effect
from estimation.fitting import fit
from estimation.model import Term
from estimation.recording import Recording
from tests.estimation import synthetic

STIFFNESS_N_M_RAD = 2.0
CROSSTALK = Candidate.of(
    Term(effect("sensor.crosstalk"), 1, {"other_reading": "motor_current_a"}), []
)
LOAD_FRICTION = Candidate.of(
    Term(
        effect("friction.load"),
        1,
        {"speed": "spindle_velocity_rad_s", "load": "distal_torque_n_m"},
    ),
    [0.1],
)


def jaw_run(k: int, crosstalk: float, load_friction: float) -> Recording:
    """Return a run with a jaw behind a cable, whose torque sensor may answer to the current."""
    made = synthetic.run(f"r{k}", 0.2 + 0.1 * (k % 3), 0.05 * (1 + k), seed=k, noise_n_m=2e-4)
    random = np.random.default_rng(900 + k)
    spindle, current = made["spindle_angle_rad"], made["motor_current_a"]
    speed = np.gradient(spindle, made.time_s)
    distal = made["proximal_torque_n_m"] / 1.4 - 0.02 * np.tanh(speed / 0.1)
    jaw = 1.4 * spindle - distal / STIFFNESS_N_M_RAD + 1e-4 * random.normal(size=len(made))
    lost = load_friction * np.abs(distal) * np.tanh(speed / 0.1)
    return made.with_columns(
        jaw_angle_rad=jaw,
        distal_torque_n_m=distal + crosstalk * current / (1 + np.abs(current) / 0.1),
        proximal_torque_n_m=made["proximal_torque_n_m"] + lost,
    )


def claimed(name: str, recordings: list[Recording], candidate: Candidate) -> Story:
    """Return the story of a balance in which one effect is claimed."""
    model = fit(model_file.read(Path(name)), Campaign.of(recordings), bootstrap=0)
    channels = [*model.channels, model.target, *(c for _, c in candidate.channels)]
    balance = lay_out(model, [prepare(r, channels, model) for r in recordings])
    before = freeze(balance, [])
    return Story(
        balance=balance,
        discovery=Discovery((), (), (), None),
        claims=(Claim(Part(candidate), "identified", None, ()),),
        refused=(),
        before=before,
        after=before,
        values=(),
        written=before,
        written_values=(),
        confirm=(),
        candidates=1,
        families=(candidate.family,),
    )


@pytest.mark.parametrize(
    ("crosstalk", "load_friction", "same"), [(0.3, 0, True), (0.3, 0.2, False)]
)
def test_a_fault_tells_what_it_makes_of_another_balance_and_no_more(crosstalk, load_friction, same):
    recordings = [jaw_run(k, crosstalk, load_friction) for k in range(6)]
    stretch = claimed("stretch", recordings, replace(CROSSTALK, sign=1))
    cable = claimed("cable", recordings, LOAD_FRICTION)
    assert follows(stretch, 0, cable, 0) is same
