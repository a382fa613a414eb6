"""The model file: what is written is read back, what is wrong is named."""

from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimation.effects import catalogue, effect
from estimation.filters import LowPass
from estimation.model import Estimate, Evidence, Model, Term
from estimation.model_file import ModelFileError, names, parse, parse_all, read, to_toml

NUMBERS = st.floats(allow_nan=False, allow_infinity=False)
ESTIMATES = st.builds(
    Estimate,
    value=NUMBERS,
    spread=st.none() | NUMBERS,
    ci95=st.none() | st.tuples(NUMBERS, NUMBERS),
)


@st.composite
def models(draw: st.DrawFn) -> Model:
    terms = []
    for kind in draw(st.lists(st.sampled_from(list(catalogue().values())), min_size=1, max_size=4)):
        names = [p.name for p in (*kind.amplitudes, *kind.shape)]
        values = draw(st.dictionaries(st.sampled_from(names), ESTIMATES))
        terms.append(Term(kind, draw(st.sampled_from([1, -1])), values=values))
    evidence = st.builds(
        Evidence,
        runs=st.lists(st.text()).map(tuple),
        samples=st.integers(0, 10**9),
        rmse=NUMBERS,
        rmse_with_means=NUMBERS,
        seed=st.integers(0, 2**31),
    )
    return Model(
        name=draw(st.text()),
        balance=draw(st.sampled_from(["motor", "cable", "joint.3", "calibration.torque"])),
        target="proximal_torque_n_m",
        terms=tuple(terms),
        description=draw(st.text()),
        run_offsets=draw(st.booleans()),
        low_pass=LowPass(draw(st.floats(0.1, 400)), draw(st.integers(1, 8))),
        counted=draw(st.sampled_from([None, "all", "motion", "closing"])),
        evidence=draw(st.none() | evidence),
    )


@settings(max_examples=40)
@given(several=st.lists(models(), min_size=1, max_size=4, unique_by=lambda one: one.balance))
def test_what_is_written_is_read_back(several):
    text = to_toml(*several)
    assert parse_all(text) == several
    assert parse(text) == several[0]


def test_shipped_models_are_declared_and_not_fitted():
    assert {"cable", "gearbox", "grip", "linear", "motor", "stretch"} <= {*names()}
    for name in names():
        model = read(Path(name))
        assert model.name == name
        assert not model.is_fitted


DECLARED = to_toml(read(Path("motor")))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("balance =", "balanse =", "lacks the key 'balance'.*Did you mean 'balanse'"),
        ("cutoff_hz", "cutof_hz", "unknown key 'cutof_hz'.*Did you mean 'cutoff_hz'"),
        ("\nsign = -1", "\nsing = -1", "unknown key 'sing'.*Did you mean 'sign'"),
        ("friction.viscous", "friction.viscos", "Did you mean 'friction.viscous'"),
        ("channels.speed", "channels.sped", "no role 'sped'.*Did you mean 'speed'"),
        ('"motor_velocity_rad_s"', '"motor_velocity"', "carries no unit"),
        ("sign = -1", "sign = 2", "it is 1 or -1"),
        ("sign = -1", 'sign = "minus"', "is not a whole number"),
        (
            "run_offsets = true",
            'run_offsets = "ja"',
            'run_offsets = "ja" is not true or false. Write run_offsets = true, or false.',
        ),
        ("order = 3", "order = true", "is not a whole number"),
        ("cutoff_hz = 50.0", "cutoff_hz = nan", "not a finite number"),
        ("rig.model/1", "rig.model/2", "not a model of schema.*version of rig"),
        ("[processing]", "[processing", "is not TOML"),
        (
            'channels.speed = "motor_velocity_rad_s"',
            'parameters.damping = { value = 1.0, unit = "N m" }',
            "stated in 'N m', not in 'N m s/rad'.*write unit = .N m s/rad",
        ),
        (
            'channels.speed = "motor_velocity_rad_s"',
            'parameters.dampng = { value = 1.0, unit = "N m" }',
            "no parameter 'dampng'.*Did you mean 'damping'",
        ),
        (
            'channels.speed = "motor_velocity_rad_s"',
            "parameters.damping = { bounds = [0.0, 1.0] }",
            "unknown key 'bounds'.*rig effects friction.viscous.*value, unit, spread, ci95",
        ),
    ],
)
def test_what_is_wrong_is_named(old, new, message):
    with pytest.raises(ModelFileError, match=message):
        parse(DECLARED.replace(old, new, 1), "mine.toml")


def test_a_mass_may_be_stated_in_kilograms():
    text = """
schema = "rig.model/1"
name = "axis"
balance = "axis"
target = "drive_force_n"
[processing]
[[effects]]
id = "inertia.missing"
channels.acceleration = "axis_acceleration_m_s2"
parameters.inertia = { value = 180.0, unit = "kg" }
"""
    (term,) = parse(text).terms
    assert term.values["inertia"].value == 180.0
    assert 'unit = "N s^2/m"' in to_toml(parse(text))


def test_an_order_along_a_position_that_was_written_without_a_unit_is_read():
    text = """
schema = "rig.model/1"
name = "axis"
balance = "axis"
target = "drive_force_n"
[processing]
[[effects]]
id = "ripple.motor"
channels.motor_angle = "axis_position_m"
parameters.order = { value = 1571.0, unit = "1" }
"""
    assert 'unit = "rad/m"' in to_toml(parse(text))
    shaft = text.replace("axis_position_m", "axis_angle_rad")
    assert 'unit = "1"' in to_toml(parse(shaft))
    with pytest.raises(ModelFileError, match="order is stated in 'rad/m'"):
        parse(shaft.replace('"1"', '"rad/m"'))


def test_a_missing_file_names_the_shipped_ones_and_one_without_a_model_is_refused(tmp_path):
    with pytest.raises(ModelFileError, match="holds no model"):
        parse_all('schema = "rig.models/1"\nmodels = []\n')
    with pytest.raises(ModelFileError, match="several models of the equation 'motor'"):
        parse_all(to_toml(read(Path("motor")), read(Path("motor"))))
    with pytest.raises(ModelFileError, match="grip, linear, motor, stretch"):
        read(tmp_path / "none.toml")


LINEAR = Model("linear", "motor", "proximal_torque_n_m", (Term(effect("motor.torque_constant")),))


def test_friction_counts_samples_in_motion_unless_the_file_declares_all():
    terms = (*LINEAR.terms, Term(effect("friction.coulomb"), -1))
    assert replace(LINEAR, terms=terms).samples == "motion"
    assert LINEAR.samples == "all"
    assert replace(LINEAR, terms=terms, counted="all").samples == "all"
