"""What is claimed of what a search found."""

import numpy as np
import pytest

from estimation.campaign import Campaign
from estimation.diagnosis.balance import lay_out
from estimation.diagnosis.candidate import pool
from estimation.diagnosis.claims import claims_of
from estimation.diagnosis.design import prepare
from estimation.diagnosis.maps import best_map
from estimation.diagnosis.naming import Discovery, Named
from estimation.diagnosis.search import Trial
from estimation.diagnosis.variables import needed_channels
from estimation.fitting import fit
from tests.estimation.test_diagnosis import MEASURED, MOTOR, QUICK, runs


@pytest.mark.parametrize(
    ("stiffness_n_m_rad", "told"),
    [(0.002, ["depends_on"]), (0.05, ["identified"])],
)
def test_a_name_dwarfed_by_a_map_of_its_own_variable_gives_way_to_it(stiffness_n_m_rad, told):
    def wavy(motor_rad, speed_rad_s, load_n_m):
        return stiffness_n_m_rad * motor_rad / 35 + 0.004 * np.sin(12 * motor_rad / 35)

    recordings = runs(wavy, count=8)
    wanted = [MOTOR.target, *MOTOR.channels, *needed_channels("motor", MEASURED)]
    made = [prepare(recording, list(dict.fromkeys(wanted)), MOTOR) for recording in recordings]
    balance = lay_out(fit(MOTOR, Campaign.of(recordings), bootstrap=0), made)
    spring = next(c for c in pool(MOTOR, MEASURED) if c.id == "spring.position")
    terms = [*balance.terms, spring]
    left = best_map(balance, terms, QUICK.draws, 0, only={"spindle_angle"})
    named = Named(spring, Trial((spring,), 0.5, 0.5, np.zeros(8)), 0.5, confidence=0.99)
    discovery = Discovery((named,), (), (), left)
    claims = claims_of(discovery, balance, QUICK, may_name=True, told=True)
    assert [claim.verdict for claim in claims] == told
