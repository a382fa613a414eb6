"""A session follows the logger's clock and states how well."""

import pytest

from drivers.clock import ClockError
from rig.bench.logger import open_logger
from rig.bench.session import Session
from rig.configuration.config import load_config

pytestmark = pytest.mark.integration


def test_a_session_states_the_residual_of_its_clock() -> None:
    config = load_config()
    session = Session(config, open_logger(config))
    with pytest.raises(ClockError):
        _ = session.clock.line
    with session:
        for _ in session.rest(3.0):
            pass
        line = session.clock.line
    assert line.exchanges >= 10
    assert line.residual_s < 1e-6
    assert line.drift_ppm == pytest.approx(0, abs=1e-3)
    assert session.clock.resets == 0
