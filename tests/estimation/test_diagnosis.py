"""Diagnosis on an analytic rig whose missing effect is known."""

from pathlib import Path
from types import SimpleNamespace

import pytest

from estimation import model_file
from estimation.campaign import Campaign
from estimation.causes.places import Entry
from estimation.causes.remarks import unwritten
from estimation.causes.verdict import Answer, answer
from estimation.diagnosis.split import split
from estimation.fit_problem import prepared
from estimation.fitting import _evidence
from estimation.recording import Flag, Stretch
from tests.estimation import synthetic
from tests.estimation.synthetic import runs, spring, spring_and_ripple

pytestmark = pytest.mark.long

MOTOR = model_file.read(Path("motor"))


def diagnosed(recordings) -> Answer:
    return answer(recordings, [MOTOR], split(recordings, 1))


def test_flagged_stretches_are_left_out():
    def broken(recording):
        wild = recording["proximal_torque_n_m"].copy()
        wild[1500:1700] = 5.0
        stretch = Stretch(1.5, 1.7, Flag.SATURATED, "sensor at its limit")
        return recording.with_columns(proximal_torque_n_m=wild).with_stretch(stretch)

    found = diagnosed([broken(r) for r in runs(spring)])
    assert found.diagnosis.findings[0].family == "spring.position"


def test_the_model_written_with_two_causes_has_the_reported_errors_on_the_test_runs():
    recordings = runs(spring_and_ripple)
    found = diagnosed(recordings)
    assert {f.family for f in found.diagnosis.findings} == {"spring.position", "ripple.motor"}
    (written,) = found.models
    assert model_file.parse(model_file.to_toml(written)) == written
    families = {t.effect.family for t in written.terms[len(MOTOR.terms) :]}
    assert families == {f.family for f in found.diagnosis.findings}
    test = Campaign.of([r for r in recordings if r.name in found.diagnosis.sealed.confirm])
    reported = found.diagnosis.errors["motor"]
    found_again = _evidence(written, prepared(written, test), 0)
    assert found_again.rmse == pytest.approx(reported.after, rel=1e-6)
    assert found_again.rmse_with_means == pytest.approx(reported.with_means_after, rel=1e-6)


@pytest.mark.parametrize(
    ("order", "why"), [(0, "the quantity that the model estimates"), (1, "the rate of change")]
)
def test_a_cause_that_no_model_holds_is_reported_with_the_reason(order, why):
    place = SimpleNamespace(home="motor", enters=[Entry("motor", 1.0, order)])
    cause = SimpleNamespace(family="sensor.gain", place=place, ahead=False)
    note = unwritten(SimpleNamespace(acts=None, cause=cause))
    assert note.startswith("motor: sensor.gain is reported and not added to the model file; ")
    assert why in note


def test_runs_at_one_load_do_not_distinguish_what_depends_on_it_and_a_note_states_it():
    same = [
        # two, three or four whole periods of the load, so that its mean does not change
        synthetic.run(f"run{k}", (2 + k % 3) / 5.4, 0.1, seed=k, seconds=6.0)
        for k in range(9)
    ]
    notes = diagnosed(same).diagnosis.notes
    assert any("is about the same in all training runs" in note for note in notes)
