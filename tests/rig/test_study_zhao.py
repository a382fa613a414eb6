"""The study of Zhao and Nelson 2016 on the simulated grasper: method, improvement, haptics."""

import numpy as np
import pytest

from rig.cli.main import main
from rig.grasper.current_force import CurrentForce
from rig.reports.zhao import markdown
from rig.simulation.grasper_inputs import end_of_hold, hold, periodic
from rig.simulation.grasper_plant import PROTOTYPES, RATE_HZ, AxisParameters, play_axis, vary
from rig.studies import zhao
from rig.studies.haptics import run_haptics

IDEAL = AxisParameters(
    coulomb_n_m=0.0, load_friction_ratio=0.0, viscous_n_m_s_rad=0.0, current_noise_a=0.0
)


def test_without_friction_the_papers_equations_give_the_force():
    played = play_axis(IDEAL, hold(IDEAL, 1.5, 3.0), 0)
    found = CurrentForce(IDEAL.arm_m).force_n(played["motor_current_a"], RATE_HZ)
    at = slice(round(end_of_hold(3.0)[0] * RATE_HZ), round(end_of_hold(3.0)[1] * RATE_HZ))
    assert found[at].mean() == pytest.approx(1.5, abs=0.01)
    assert played["force_n"][at].mean() == pytest.approx(1.5, abs=0.01)


def test_inputs_reach_the_force_they_are_asked_for():
    played = play_axis(IDEAL, periodic(IDEAL, 1.0), 0)
    last_cycle = played["force_n"][-round(RATE_HZ / 2) :]
    assert last_cycle.max() == pytest.approx(1.0, abs=0.1)
    assert last_cycle.min() == pytest.approx(0.0, abs=0.1)


def test_a_held_grasp_lets_go_of_friction_and_not_of_force():
    axis = PROTOTYPES["third"].axes["pitch"][0]
    played = play_axis(axis, hold(axis, 1.5, 10.0), 0)
    current, force = (
        [values[round(t * RATE_HZ) :][:400].mean() for t in (1.1, 10.5)]
        for values in (played["motor_current_a"], played["force_n"])
    )
    assert current[1] < 0.85 * current[0]
    assert force[1] == pytest.approx(force[0], rel=0.03)


def test_graspers_differ_by_their_seed_and_repeat_by_it():
    axis = PROTOTYPES["third"].axes["yaw"][0]
    assert vary(axis, 3, 0.1) == vary(axis, 3, 0.1) != vary(axis, 4, 0.1)
    assert vary(axis, 3, 0.0) == axis


@pytest.fixture(scope="module")
def mean_grasper():
    return {
        dof: zhao.measure(zhao.axes_of(PROTOTYPES["third"], dof, 0, 0.0), 0)
        for dof in ("grasp", "pitch")
    }


def test_the_papers_method_lands_near_its_table(mean_grasper):
    for dof, cell in mean_grasper.items():
        stated = np.array(zhao.PAPER_ERRORS_N[dof])
        assert (np.abs(cell.paper.errors_n - stated) < 0.25 * stated).all()
    assert mean_grasper["grasp"].slope == pytest.approx(1.28, abs=0.05)


def test_ours_is_at_most_half_of_it_without_more_delay(mean_grasper):
    for cell in mean_grasper.values():
        paper, ours = np.abs(cell.paper.errors_n), np.abs(cell.ours.errors_n)
        assert (ours <= np.maximum(paper / 2, 0.03)).all()
        assert abs(cell.ours.delay_ms) <= 10


def test_the_added_friction_is_what_makes_the_difference(mean_grasper):
    cell = mean_grasper["grasp"]
    assert np.abs(cell.ours.errors_n)[:2].max() < 0.5 * np.abs(cell.undeclared.errors_n)[:2].max()


def test_every_grasper_is_in_the_report(mean_grasper):
    cells = {dof: [mean_grasper["grasp"]] for dof in zhao.DOFS}
    text = markdown(zhao.Study("third prototype", 0.1, cells))
    assert "| yaw, 0 |" in text
    assert "| pitch, periodic | +0.71 |" in text


@pytest.mark.parametrize("seed", [5])
def test_haptics_are_right_also_with_friction_not_declared(seed):
    answers = run_haptics(seed)
    assert [answer.method for answer in answers][-1] == "ours, friction not declared"
    for answer in answers:
        assert answer.order_is_right
        assert answer.found == answer.true
        assert min(answer.order_confidence, answer.place_confidence) > 0.95
    ours = answers[1]
    for material in ours.materials:
        assert material.mean_n_rad == pytest.approx(material.true_n_rad, rel=0.15)


def test_an_unknown_prototype_is_refused(capsys):
    assert main(["study", "zhao", "--prototype", "fourth"]) == 2
    assert "third, journal, ball" in capsys.readouterr().err
