"""The planetary wrist: path lengths, the decoupling rule, and the choice among 27 designs."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig.grasper.coupling import GrasperError
from rig.grasper.wrist import CablePath, Planetary, designs, most_compact

PATH = CablePath(0.004, 0.004, 0.005, 0.01, 0.006, 0.008)
ratios = st.floats(0.3, 3.0)
angles = st.floats(-0.7, 0.7)


def test_the_path_length_is_that_of_its_straight_lines_and_arcs():
    # two equal pulleys that just touch: the cable crosses between them with no straight length
    d = 0.004
    path = CablePath(d, d, d, 0.0, d, d)
    assert path.tangent_angles_rad() == (0.0, 0.0)
    assert path.length_m() == pytest.approx(math.pi * d)  # a quarter, a half and a quarter turn


@given(angles, angles, ratios)
def test_equation_5_is_the_difference_of_equations_1_and_4(alpha, beta, ratio):
    d1, d2, d3 = 0.004, 0.004 * ratio, 0.005
    path = CablePath(d1, d2, d3, 0.01, 0.51 * (d1 + d2), 0.51 * (d2 + d3))
    change = path.length_m() - path.length_m(alpha, beta)
    assert path.shortening_m(alpha, beta) == pytest.approx(change, abs=1e-15)


@given(ratios, st.floats(-3.0, 0.5), angles)
def test_the_rule_decouples_whatever_the_gears(ratio, sun, alpha):
    gears = Planetary(ratio, sun)
    path = CablePath(0.004, 0.004 * gears.decoupling_pulley_ratio, 0.005, 0.0, 0.1, 0.1)
    beta = alpha / gears.alpha_over_beta
    assert path.shortening_m(alpha, beta) == pytest.approx(0.0, abs=1e-15)


def test_the_papers_wrist_turns_twice_its_input():
    assert Planetary(1.0).yaw_over_carrier == 2.0
    assert Planetary(1.0).decoupling_pulley_ratio == 1.0  # equation 11
    assert Planetary(1.0, -1.0).decoupling_pulley_ratio == 0.5  # equation 10


def test_overlapping_pulleys_are_refused():
    path = CablePath(0.004, 0.004, 0.005, 0.01, 0.0039, 0.008)
    assert len(path.interference()) == 1
    with pytest.raises(GrasperError, match=r"pulleys 1 and 2 overlap by 0\.0001 m"):
        path.length_m()
    assert PATH.interference() == []


def test_a_cable_that_lifts_off_its_pulley_is_refused():
    with pytest.raises(GrasperError, match="lifts off pulley 1"):
        PATH.length_m(-1.5, 0.0)
    with pytest.raises(GrasperError, match="lifts off pulley 2"):
        PATH.length_m(0.0, 3.0)


@pytest.mark.parametrize("gear_ratios", [(1.0, 2.0, 3.0), (1.0, 1 / 2, 1 / 3)])
def test_of_27_designs_the_papers_is_the_most_compact(gear_ratios):
    found = designs(gear_ratios)
    assert len({(d.planetary, d.drive) for d in found}) == 27
    best = most_compact(found)
    assert (best.planetary, best.drive) == (Planetary(1.0, 0.0), "carrier")
    rivals = [d for d in found if d is not best and not d.obstacle]
    assert all((d.area, d.extra_stages) > (best.area, best.extra_stages) for d in rivals)


@pytest.mark.parametrize(("ratio", "sun"), [(0.0, 0.0), (math.nan, 0.0), (1.0, 1.0)])
def test_gears_that_cannot_be_are_refused(ratio, sun):
    with pytest.raises(GrasperError):
        Planetary(ratio, sun)
