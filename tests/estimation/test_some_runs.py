"""Effects that only some of the runs have."""

import numpy as np
import pytest

from estimation.diagnosis.result import Diagnosis, Finding
from tests.estimation.test_diagnosis import diagnosed, runs

pytestmark = pytest.mark.long

HAVE = (1, 2, 5, 8, 10, 11)


def ripple(motor_rad, speed_rad_s, load_n_m):
    return 0.004 * np.sin(3 * motor_rad)


def of_some(extra, count: int = 12, have=HAVE):
    plain, missing = runs(count=count), runs(extra, count=count)
    return [missing[k] if k in have else plain[k] for k in range(count)]


def told(recordings) -> tuple[Diagnosis, Finding]:
    diagnosis, _ = diagnosed(recordings)
    (finding,) = diagnosis.findings
    return diagnosis, finding


def test_an_effect_of_some_runs_is_named_with_the_runs_that_have_it():
    diagnosis, finding = told(of_some(ripple))
    assert (finding.family, finding.verdict) == ("ripple.motor", "identified")
    assert finding.runs_affected == tuple(f"run{k:02d}" for k in HAVE)
    assert finding.parameters["order"].value == pytest.approx(3.0, abs=0.01)
    assert finding.confidence == pytest.approx(1 - 0.5 ** len(HAVE))
    opened = set(finding.runs_affected) & set(diagnosis.sealed.confirm)
    assert finding.runs_improved == len(opened) > 0
    assert finding.rmse_after < finding.rmse_before
    # the runs that lack it would be worse with it, so no model holds it
    assert diagnosis.errors["motor"].after == diagnosis.errors["motor"].before


def test_where_a_form_leaves_much_in_those_runs_none_is_named():
    _, finding = told(of_some(lambda motor, *_: 0.003 * (np.sin(3 * motor) + np.sin(4.5 * motor))))
    assert (finding.family, finding.verdict) == ("unknown", "something_missing")
    assert finding.runs_affected == tuple(f"run{k:02d}" for k in HAVE)
    assert finding.confidence is None
    assert not finding.parameters


def test_two_runs_are_too_few():
    diagnosis, _ = diagnosed(of_some(ripple, have=(3, 7)))
    assert diagnosis.findings == ()
