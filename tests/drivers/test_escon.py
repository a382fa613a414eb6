"""ESCON 24/2: two-point scaling, what is refused, and the module's own behaviour."""

import ctypes
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.escon.fake import EsconFake
from drivers.escon.scaling import EsconWiring, Line, SetValueError
from drivers.teensy.reference import SAMPLE_DTYPE

PWM = EsconWiring(Line(0.1, 0.0, 0.9, 2.0), "pwm", Line(0.0, -2.0, 3.3, 2.0))
ANALOG = EsconWiring(Line(0.0, 0.0, 3.3, 1.0), "analog", Line(0.3, -1.0, 3.0, 1.0), limit_a=1.0)
BOTH = pytest.mark.parametrize("wiring", [PWM, ANALOG], ids=["pwm", "analog"])


def test_the_public_example_of_this_very_module() -> None:
    """Duty 0.1 + 0.8 |I| / 2 A; read back I = 2 (adc / 4096 - 0.5) 2 A."""
    one_way = Line(0.1, 0.0, 0.9, 2.0)
    assert one_way.input_of(1.0) == pytest.approx(0.5)
    read_back = Line(0.0, -2.0, 3.3, 2.0)
    assert read_back.current_a(3.3 * 0.75) == pytest.approx(2 * (0.75 - 0.5) * 2.0)


@BOTH
@given(ratio=st.floats(-1, 1))
def test_a_current_is_asked_for_to_half_a_step(wiring: EsconWiring, ratio: float) -> None:
    current_a = ratio * wiring.limit_a
    code = wiring.output_code(current_a)
    step_a = abs(wiring.current_of_code(1) - wiring.current_of_code(0))
    assert abs(wiring.current_of_code(code) - abs(current_a)) <= 0.5001 * step_a
    if wiring.kind == "pwm":
        assert 0.0998 <= code / 4095 <= 0.9002


@BOTH
@pytest.mark.parametrize("current_a", [math.nan, math.inf, -math.inf, 2.001, -7.0])
def test_what_cannot_be_asked_is_refused(wiring: EsconWiring, current_a: float) -> None:
    with pytest.raises(SetValueError, match="cannot be asked"):
        wiring.output_code(current_a)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((Line(0.0, 0.0, 1.0, 4.0), "pwm", Line(0, -2, 3.3, 2)), "would need"),
        ((Line(0.0, 0.0, 10.0, 1.0), "analog", Line(0, -2, 3.3, 2)), "would need"),
    ],
)
def test_points_that_do_not_fit_the_output_are_refused(arguments: tuple, message: str) -> None:
    with pytest.raises(SetValueError, match=message):
        EsconWiring(*arguments)


def test_points_that_make_no_line_are_refused() -> None:
    with pytest.raises(SetValueError, match="make no line"):
        Line(1.0, 0.0, 1.0, 2.0)


@BOTH
def test_the_module_gives_the_set_current_and_reports_it(wiring: EsconWiring) -> None:
    module = EsconFake(wiring)
    code = wiring.output_code(0.5)
    readings = [module.tick(code, enable=True) for _ in range(60)]
    assert module.current_a == pytest.approx(0.5, abs=2e-3)
    told = np.mean([wiring.current_of_reading(reading) for reading in readings[20:]])
    assert told == pytest.approx(0.5, abs=5e-3)


def test_enable_acts_after_its_delay_and_disable_at_once() -> None:
    module = EsconFake(PWM)
    code = PWM.output_code(1.0)
    currents = []
    for _ in range(20):
        module.tick(code, enable=True)
        currents.append(module.current_a)
    assert currents[:8] == [0.0] * 8
    assert currents[-1] > 0.99
    module.tick(code, enable=False)
    assert module.current_a == 0.0


def test_a_fault_takes_ready_away_until_enable_is_given_anew() -> None:
    module = EsconFake(PWM)
    code = PWM.output_code(1.0)
    for _ in range(20):
        module.tick(code, enable=True)
    module.fault = True
    module.tick(code, enable=True)
    assert not module.ready
    assert module.current_a == 0.0
    module.tick(code, enable=False)
    module.tick(code, enable=True)
    assert module.ready


def test_a_duty_outside_the_range_is_taken_as_its_end() -> None:
    module = EsconFake(PWM)
    for code, size_a in ((0, 0.0), (4095, 2.0)):
        for _ in range(12):
            module.tick(code, enable=True, positive=False)
        assert module.current_a == pytest.approx(-size_a, abs=1e-6)


def test_its_current_is_a_channel_of_the_logger() -> None:
    samples = np.zeros(2, SAMPLE_DTYPE)
    samples["current"] = [0, 4095]
    channel = PWM.channel()
    np.testing.assert_allclose(channel.values(samples), [-2.0, 2.0])
    assert channel.channel.unit == "A"


@given(st.floats(-3, 3), st.integers(1, 4094))
def test_the_board_scales_alike(library: Path, current_a: float, reading: int) -> None:
    core = ctypes.CDLL(str(library))
    core.rig_escon_code.argtypes = [ctypes.c_double]
    expected = PWM.output_code(min(max(current_a, -2.0), 2.0))
    assert core.rig_escon_code(current_a) == expected
    told_ma = math.floor(1000 * PWM.current_of_reading(reading) + 0.5)
    assert core.rig_escon_milliampere(reading) == told_ma
    assert core.rig_escon_code(math.nan) == PWM.output_code(0.0)
