"""When two balances show one fault."""

from dataclasses import replace

import pytest

from estimation.diagnosis.findings import Told, echoes, findings_of, same_fault
from estimation.diagnosis.result import Finding, Value


def finding(balance: str, family: str, depends_on=(), **parameters: float) -> Finding:
    return Finding(
        balance=balance,
        family=family,
        verdict="identified",
        rmse_before=2.0,
        rmse_after=1.0,
        runs_improved=4,
        runs_total=4,
        runs_affected=(),
        depends_on=depends_on,
        parameters={name: Value(value, "1", None) for name, value in parameters.items()},
    )


@pytest.mark.parametrize(
    ("second", "same"),
    [
        (("gearbox", "sensor.creep"), True),
        (("cable", "unknown"), True),
        (("cable", "hysteresis.presliding"), False),
        (("stretch", "sensor.creep"), False),  # it reads no sensor of the motor's
    ],
)
def test_a_sensor_at_fault_shows_in_every_balance_that_reads_it(second, same):
    assert same_fault(finding("motor", "sensor.creep"), finding(*second)) is same


def test_a_lag_and_a_delay_of_one_sensor_are_one_fault():
    assert same_fault(finding("motor", "sensor.lag"), finding("gearbox", "sensor.delay"))


@pytest.mark.parametrize(("order", "same"), [(0.4, True), (0.5, False), (0.8, True), (2.0, False)])
def test_waves_are_one_when_they_come_as_often_a_turn(order, same):
    gear = finding("gearbox", "ripple.output", ("spindle_angle",), order=14.0)
    motor = finding("motor", "ripple.motor", ("motor_angle",), order=order)
    assert same_fault(gear, motor) is same


def test_a_wave_that_a_sensor_is_blamed_for_is_one_with_the_wave_of_another_balance():
    gear = finding("gearbox", "sensor.encoder_inl", ("spindle_angle",), order=14.0)
    motor = finding("motor", "eccentric.load", ("spindle_angle", "load"), order=14.1)
    assert same_fault(gear, motor)


@pytest.mark.parametrize(
    ("verdict", "share", "small"),
    [
        ("identified", 0.04, True),
        ("identified", 0.08, False),
        ("one_of", 0.08, True),
        ("one_of", 0.4, False),
    ],
)
def test_what_is_surely_named_is_sooner_told_from_an_echo(verdict, share, small):
    dwell = Told(finding("cable", "friction.dwell"), {}, None, 0, 0.9)
    named = replace(finding("motor", "friction.coulomb_asymmetry"), verdict=verdict)
    assert bool(echoes([dwell, Told(named, {}, None, 0, share)])) is small


@pytest.mark.parametrize(("share", "small"), [(0.1, {"gearbox": {0}}), (0.5, {})])
def test_a_small_claim_beside_a_large_one_elsewhere_is_not_told_from_its_echo(share, small):
    ripple = Told(finding("motor", "ripple.motor"), {}, None, 0, 0.9)
    inertia = Told(finding("gearbox", "inertia.missing"), {}, None, 0, share)
    told = [ripple, inertia]
    assert echoes(told) == small


@pytest.mark.parametrize(("family", "small"), [("inertia.missing", True), ("friction.load", False)])
def test_what_any_faster_motion_shows_is_sooner_taken_for_an_echo(family, small):
    lag = Told(finding("motor", "sensor.lag"), {}, None, 0, 0.6)
    other = Told(finding("gearbox", family), {}, None, 0, 0.35)
    assert bool(echoes([lag, other])) is small


@pytest.mark.parametrize(
    ("depends_on", "echo"),
    [(("velocity", "acceleration"), True), (("velocity", "spindle_angle"), False)],
)
def test_what_has_no_name_and_is_motion_alone_gives_way_to_a_cause_that_has_one(depends_on, echo):
    unnamed = replace(finding("stretch", "unknown", depends_on), verdict="depends_on")
    shaking = Told(unnamed, {}, None, 0, 0.6)
    lag = Told(finding("motor", "motor.electrical"), {}, None, 0, 0.7)
    assert bool(echoes([lag, shaking])) is echo
    assert replace(lag, share=0.3).is_surer_than(shaking) is echo


def test_findings_come_in_the_order_found_however_much_each_explains():
    small, large = finding("motor", "friction.drag"), finding("motor", "ripple.motor")
    told = [  # in the order of what each explains
        Told(finding("gearbox", "sensor.creep"), {}, None, 0, 0.9),
        Told(large, {}, None, 1, 0.8),
        Told(small, {}, None, 0, 0.1),
    ]
    listed = findings_of(told, ["motor", "gearbox"])
    assert [f.family for f in listed] == ["friction.drag", "ripple.motor", "sensor.creep"]


@pytest.mark.parametrize(
    ("family", "share", "verdict", "surer"),
    [
        ("gravity.payload", 0.9, "identified", True),
        ("gravity.payload", 0.9, "one_of", True),  # no encoder makes a torque
        ("gravity.payload", 0.2, "identified", False),
    ],
)
def test_what_two_balances_show_is_told_by_the_one_that_names_it_better(
    family, share, verdict, surer
):
    wave = Told(finding("stretch", "sensor.encoder_inl"), {}, None, 0, 0.8)
    other = Told(replace(finding("cable", family), verdict=verdict), {}, None, 0, share)
    assert other.is_surer_than(wave) is surer


@pytest.mark.parametrize(
    ("family", "share", "verdict", "surer"),
    [
        ("gravity.payload", 0.9, "identified", True),
        ("gravity.payload", 0.9, "one_of", False),
        ("gravity.payload", 0.5, "identified", False),
        ("sensor.crosstalk", 0.9, "identified", False),  # what the other names already
    ],
)
def test_a_torque_sensors_fault_gives_way_to_a_name_that_explains_as_much(
    family, share, verdict, surer
):
    fault = Told(finding("stretch", "sensor.crosstalk"), {}, None, 0, 0.8)
    other = Told(replace(finding("cable", family), verdict=verdict), {}, None, 0, share)
    assert other.is_surer_than(fault) is surer


@pytest.mark.parametrize(
    ("here", "family", "there", "behind"),
    [
        ("spindle_angle", "sensor.encoder_inl", "jaw_angle", True),
        ("spindle_angle", "sensor.gain_nonlinear", "spindle_angle", True),
        ("spindle_angle", "sensor.gain_nonlinear", "load", False),
        ("load", "sensor.encoder_inl", "jaw_angle", False),
        ("spindle_angle", "unknown", "jaw_angle", True),
        ("spindle_angle", "coupling.kinematic", "jaw_angle", False),
    ],
)
def test_a_torque_that_no_sensor_reads_is_behind_what_goes_with_the_angle(
    here, family, there, behind
):
    weight = Told(finding("cable", "gravity.payload", (here,)), {}, None, 0, 0.5)
    stretch = Told(finding("stretch", family, (there,)), {}, None, 0, 0.8)
    assert weight.acts_behind(stretch) is behind
    assert not stretch.acts_behind(weight)
    assert not replace(weight, share=0.2).acts_behind(stretch)


def test_a_map_without_a_name_speaks_for_a_sensor_but_not_for_another_map():
    unnamed = replace(finding("cable", "unknown", ("spindle_angle",)), verdict="depends_on")
    detent = Told(unnamed, {}, None, 0, 0.5)
    wave = Told(finding("stretch", "sensor.encoder_inl", ("jaw_angle",)), {}, None, 0, 0.8)
    assert detent.acts_behind(wave)
    assert not detent.acts_behind(replace(wave, finding=replace(unnamed, balance="stretch")))
