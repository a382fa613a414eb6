"""A sensor's fault that another balance reading that sensor does not show is no fault of it."""

from dataclasses import replace

import numpy as np
import pytest

from estimation.diagnosis.candidate import Candidate
from estimation.diagnosis.naming import Discovery, Named
from estimation.diagnosis.search import Trial
from estimation.diagnosis.shared_sensors import denied
from estimation.effects import effect
from estimation.model import Term
from tests.estimation.test_consequences import LOAD_FRICTION, claimed, jaw_run

CHANNELS = {"clock": "time_s", "creeping": "distal_torque_n_m"}
CREEP = Candidate.of(Term(effect("sensor.creep"), 1, CHANNELS), [1.0, 1.0])


def creeping(k, sensor, cable):
    """Return a run whose distal sensor creeps, or whose cable does, by these shares."""
    made = jaw_run(k, 0.0, 0.0)
    inputs = {"clock": made.time_s, "creeping": made["distal_torque_n_m"]}
    behind = effect("sensor.creep").columns(inputs, (1.0, 1.0))[:, 0]
    return made.with_columns(
        distal_torque_n_m=made["distal_torque_n_m"] + sensor * behind,
        jaw_angle_rad=made["jaw_angle_rad"] - 0.5 * cable * behind,
    )


def blamed(story):
    """Return the story of a balance that names the creep of the sensor."""
    named = Named(CREEP, Trial((CREEP,), 0.5, 0.5, np.ones(len(story.balance.runs))), 0.5)
    return replace(story, discovery=Discovery((named,), (), (), None))


@pytest.mark.parametrize(("sensor", "cable", "faults"), [(0.3, 0.0, 0), (0.0, 0.3, 1)])
def test_creep_of_a_sensor_must_show_in_both_balances_that_read_it(sensor, cable, faults):
    recordings = [creeping(k, sensor, cable) for k in range(6)]
    stretch = blamed(claimed("stretch", recordings, CREEP))
    stories = {"stretch": stretch, "cable": claimed("cable", recordings, LOAD_FRICTION)}
    told = denied(stories)
    assert sum(map(len, told.values())) == faults
    if faults:
        assert told == {"stretch": {("sensor.creep", "distal_torque_n_m")}}


def test_without_another_balance_nothing_is_denied():
    recordings = [creeping(k, 0.0, 0.3) for k in range(6)]
    assert denied({"stretch": blamed(claimed("stretch", recordings, CREEP))}) == {}
