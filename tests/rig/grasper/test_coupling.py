"""Graspers: inverse, power, decoupling, the wrist's path lengths, the choice among 27 designs."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from rig.grasper.coupling import Coupling, GrasperError
from rig.grasper.dvrk import dvrk_coupling, dvrk_couplings
from rig.grasper.wrist import CablePath, Planetary, designs, most_compact, planetary_grasper

PATH = CablePath(0.004, 0.004, 0.005, 0.006, 0.008)
GRASPERS = [
    planetary_grasper(PATH),
    planetary_grasper(replace(PATH, d2_m=0.003)),
    *dvrk_couplings().values(),
]
graspers = st.sampled_from(GRASPERS)


def actuator_torque(grasper, joint_n_m):
    """Return the actuator torques that hold joint torques; A^T, by equal power."""
    return np.asarray(joint_n_m) @ grasper.jacobian


def vectors(size):
    return hnp.arrays(np.float64, (3, size), elements=st.floats(-100, 100))


@given(graspers, st.data())
def test_inverse_of_forward_is_identity_and_power_is_conserved(grasper, data):
    velocity, torque = (data.draw(vectors(len(grasper.joints))) for _ in range(2))
    back = grasper.actuator_position(grasper.joint_position(velocity))
    np.testing.assert_allclose(back, velocity, atol=1e-9)
    back = actuator_torque(grasper, grasper.joint_torque(torque))
    np.testing.assert_allclose(back, torque, atol=1e-9)
    at_joints = np.sum(torque * grasper.joint_position(velocity), axis=-1)
    at_actuators = np.sum(actuator_torque(grasper, torque) * velocity, axis=-1)
    np.testing.assert_allclose(at_joints, at_actuators, rtol=1e-9, atol=1e-8)


turns = st.floats(-100, 100)


@given(st.floats(0.4, 2.5), st.floats(-2.0, 0.0), turns, turns)
def test_decoupled_motion_stays_decoupled(gear_ratio, sun, yaw_motor, jaw_motor):
    gears = Planetary(gear_ratio, sun)
    path = CablePath(0.004, 0.004 * gears.decoupling_pulley_ratio, 0.005, 0.02, 0.02)
    grasper = planetary_grasper(path, gears)
    yaw, pitch, grasp = grasper.joint_position([yaw_motor, 0.0, 0.0])
    assert (pitch, grasp) == pytest.approx((0.0, 0.0), abs=1e-12)
    assert yaw == pytest.approx(yaw_motor * gears.yaw_over_carrier / 66)
    moved = grasper.joint_position([0.0, jaw_motor, jaw_motor])
    assert moved[[0, 2]] == pytest.approx(0.0, abs=1e-12)
    closed = grasper.joint_position([0.0, jaw_motor, -jaw_motor])
    assert closed[:2] == pytest.approx(0.0, abs=1e-12)


def test_the_papers_grasper():
    grasper = planetary_grasper(replace(PATH, d3_m=0.004))
    turn = 2 * math.pi * 66
    # carrier one turn: yaw two; drum twice the jaw's pulley: jaw two turns
    assert grasper.joint_position([turn, 0, 0]) == pytest.approx([4 * math.pi, 0, 0])
    assert grasper.joint_position([0, turn, 0]) == pytest.approx([0, 2 * math.pi, 4 * math.pi])
    # a grasp torque is shared by both jaws, with opposite sign
    assert actuator_torque(grasper, [0, 0, 0.33]) == pytest.approx([0, 0.01, -0.01])


def test_the_cadiere_forceps_torques_and_the_printed_equation_4():
    grasper = dvrk_coupling("400049")
    jaw_alone = [0.0, 0.0, 0.0, 1.0]
    assert actuator_torque(grasper, jaw_alone) == pytest.approx([0, 0, -1.2177, 1.2177])
    printed = [
        [-0.6397, 0, 0, 0],
        [0, 0.9817, 0.6696, 0.6696],
        [0, 0, 0.8212, 0.8212],
        [0, 0, -0.4106, 0.4106],
    ]
    # the erratum: what is printed as joint to actuator torque maps the other way
    to_joints = grasper.joint_torque(np.eye(4)).T
    np.testing.assert_allclose(to_joints, printed, atol=1e-4)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Coupling("flat", ("a", "b"), np.ones((2, 2))), "cannot be inverted"),
        (lambda: planetary_grasper(replace(PATH, l3_m=0.004)), "overlap"),
        (lambda: GRASPERS[0].joint_position([1.0, 2.0]), "last axis"),
        (lambda: dvrk_coupling("1"), "no coupling"),
        (lambda: Planetary(0.0, 0.0), "."),
        (lambda: Planetary(math.nan, 0.0), "."),
        (lambda: Planetary(1.0, 1.0), "."),
        (
            CablePath(0.004, 0.004, 0.005, 0.0039, 0.008).tangent_angles_rad,
            r"pulleys 1 and 2 overlap by 0\.0001 m",
        ),
    ],
)
def test_what_makes_no_grasper_is_refused(make, message):
    with pytest.raises(GrasperError, match=message):
        make()


def length_m(path, alpha=0.0, beta=0.0):
    """Return the path's length by equations 1 and 4, without its straight ends."""
    theta1, theta2 = path.tangent_angles_rad()
    arcs = [
        path.d1_m / 2 * (math.pi / 2 - theta1 + alpha),
        path.d2_m / 2 * (math.pi - theta1 - theta2 - beta),
        path.d3_m / 2 * (math.pi / 2 - theta2),
    ]
    first, second = (path.d1_m + path.d2_m) / 2, (path.d2_m + path.d3_m) / 2
    return sum(arcs) + first * math.tan(theta1) + second * math.tan(theta2)


def test_the_path_length_is_that_of_its_straight_lines_and_arcs():
    # two equal pulleys that just touch: the cable crosses between them with no straight length
    d = 0.004
    path = CablePath(d, d, d, d, d)
    assert path.tangent_angles_rad() == (0.0, 0.0)
    assert length_m(path) == pytest.approx(math.pi * d)  # a quarter, a half and a quarter turn
    assert path.interference() == []


@given(st.floats(-0.7, 0.7), st.floats(-0.7, 0.7), st.floats(0.3, 3.0))
def test_equation_5_is_the_difference_of_equations_1_and_4(alpha, beta, ratio):
    d1, d2, d3 = 0.004, 0.004 * ratio, 0.005
    path = CablePath(d1, d2, d3, 0.51 * (d1 + d2), 0.51 * (d2 + d3))
    change = length_m(path) - length_m(path, alpha, beta)
    assert path.shortening_m(alpha, beta) == pytest.approx(change, abs=1e-15)


@pytest.mark.parametrize("gear_ratios", [(1.0, 2.0, 3.0), (1.0, 1 / 2, 1 / 3)])
def test_of_27_designs_the_papers_is_the_most_compact(gear_ratios):
    found = designs(gear_ratios)
    assert len({(d.planetary, d.drive) for d in found}) == 27
    best = most_compact(found)
    assert (best.planetary, best.drive) == (Planetary(1.0, 0.0), "carrier")
    rivals = [d for d in found if d is not best and not d.obstacle]
    assert all((d.area, d.extra_stages) > (best.area, best.extra_stages) for d in rivals)
