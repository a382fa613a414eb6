"""What a named effect is held against, and which of the two leads."""

from types import SimpleNamespace

import numpy as np
import pytest

from estimation.diagnosis.candidate import Candidate
from estimation.diagnosis.evidence import Losses
from estimation.diagnosis.gates import Gates
from estimation.diagnosis.rivals import Tried, beaten, better, with_alike

SEARCH = SimpleNamespace(gates=Gates())
RUNS = 8


def tried(name, channel, added=(1.0, 0.0), left=1.0, bent=1.0, shown=True):
    """Return an effect with a share of the error left, alike in all runs, and what it adds."""
    base = np.full((RUNS, 1), 10.0)
    joint = np.full((RUNS, 1, 1), left) + 0.01 * np.arange(RUNS)[:, None, None]
    candidate = Candidate(name, 1, (("load", channel),), ())
    return Tried(candidate, Losses(base, joint), np.full(RUNS, bent), np.array(added), shown)


def test_a_set_holds_what_does_the_same_as_one_of_it_though_the_runs_do_not_show_it():
    named = tried("motor.saturation", "motor_current_a", added=(1.0, 0.0))
    unbeaten = tried("friction.load", "proximal_torque_n_m", added=(0.6, 0.8))
    same = tried("friction.load_viscous", "motor_velocity_rad_s", (0.58, 0.82), shown=False)
    other = tried("motor.thermal", "time_s", added=(-0.6, 0.8), shown=False)
    assert with_alike([unbeaten], named, [unbeaten, same, other]) == [unbeaten, same]


@pytest.mark.parametrize(
    ("left", "bent", "leads"),
    [
        (0.99, 0.99, True),  # a little better as it is and in any form
        (0.99, 1.01, False),  # only as it is
        (1.01, 0.80, True),  # clearly better in any form
        (1.01, 0.99, False),
    ],
)
def test_the_likelier_of_two_that_are_not_told_apart_leads(left, bent, leads):
    named = tried("motor.saturation", "motor_current_a")
    rival = tried("friction.load", "proximal_torque_n_m", left=left, bent=bent)
    assert better(SEARCH, named, [rival], []) == (rival.candidate if leads else None)


@pytest.mark.parametrize(("left", "leads"), [(0.99, True), (1.01, False)])
def test_of_two_that_read_the_same_the_form_that_leaves_less_leads(left, leads):
    named = tried("sensor.lag", "distal_torque_n_m", bent=0.9)
    rival = tried("sensor.delay", "distal_torque_n_m", left=left, bent=1.0)
    assert better(SEARCH, named, [rival], []) == (rival.candidate if leads else None)


@pytest.mark.parametrize(
    ("added", "bent", "lost"),
    [
        ((1.0, 0.1), 1.10, False),  # it does nearly the same: a tenth may be the form
        ((1.0, 0.1), 1.25, True),
        ((0.6, 0.8), 1.10, True),
        ((0.6, 0.8), 1.02, False),
    ],
)
def test_what_does_nearly_the_same_is_beaten_by_more_than_its_form(added, bent, lost):
    named = tried("friction.load", "proximal_torque_n_m", added=(1.0, 0.0))
    rival = tried("motor.saturation", "motor_current_a", added, bent=bent)
    assert beaten(SEARCH, named, rival) is lost
