"""Training a network: it needs torch, and is skipped visibly without it."""

import numpy as np
import pytest

from estimation.errors import MissingExtraError
from estimation.networks import training
from estimation.networks.network import NetworkError
from estimation.networks.training import Settings, train
from tests.estimation.test_networks import IN, OUT, make

pytestmark = pytest.mark.integration

pytest.importorskip("torch", reason="torch is not installed (extra learn)")


def rows(count: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform([-1.0, 0.0], [2.0, 0.5], (count, 2))


def test_training_recovers_a_known_function_and_its_noise():
    truth, noise = make(3), 0.02
    x, unseen = rows(1500), rows(500, seed=5)
    half = np.ptp(truth.output_range, axis=0) / 2
    y = truth(x) + noise * half * np.random.default_rng(2).normal(size=(1500, 2))
    found = train(x, y, (IN, OUT), Settings(nodes=8))
    assert found.converged
    error = (found.network(unseen) - truth(unseen)) / half
    assert np.sqrt(np.mean(error**2)) < 0.15 * noise  # far below the noise of one sample
    true_count = truth.hidden.size + truth.output.size
    assert found.effective_parameters < 0.8 * found.parameters
    assert 0.5 * true_count < found.effective_parameters < 2 * true_count


def test_pure_noise_determines_almost_no_weight():
    y = np.random.default_rng(3).normal(size=(800, 1))
    found = train(rows(800), y, (IN, OUT[:1]), Settings(nodes=8))
    assert found.effective_parameters < found.parameters / 3
    assert np.std(found.network(rows(300, 9))) < 0.25


def test_blocks_of_rows_do_not_matter_and_the_seed_fixes_the_result(monkeypatch):
    x = rows(900)
    y = np.sin(3 * x[:, :1]) * x[:, 1:]
    settings = Settings(nodes=6, iterations=40, seed=4)
    whole = train(x, y, (IN, OUT[:1]), settings)
    again = train(x, y, (IN, OUT[:1]), settings)
    np.testing.assert_array_equal(again.network.hidden, whole.network.hidden)
    monkeypatch.setattr(training, "BLOCK", 100)
    blocks = train(x, y, (IN, OUT[:1]), settings)
    np.testing.assert_allclose(blocks.network(x), whole.network(x), atol=2e-3)
    other = train(x, y, (IN, OUT[:1]), Settings(nodes=6, iterations=40, seed=5))
    assert not np.array_equal(other.network.hidden, whole.network.hidden)


def test_rows_that_cannot_be_learnt_from_are_refused(monkeypatch):
    x, y = rows(100), rows(100, seed=1)[:, :1]
    with pytest.raises(NetworkError, match="motor_current_a"):
        train(np.column_stack([x[:, 0], np.ones(100)]), y, (IN, OUT[:1]))
    with pytest.raises(NetworkError, match="proximal_torque_n_m"):
        train(x, np.full((100, 1), np.nan), (IN, OUT[:1]))
    with pytest.raises(NetworkError, match="too few for 121 weights"):
        train(x, y, (IN, OUT[:1]))
    with pytest.raises(NetworkError, match="do not hold 2 columns"):
        train(x[:, :1], y, (IN, OUT[:1]))
    monkeypatch.setattr(training, "has_torch", lambda: False)
    with pytest.raises(MissingExtraError, match="torch, which is not installed"):
        train(x, y, (IN, OUT[:1]))


def test_training_goes_on_from_another_network():
    source = make(3)
    x = rows(400)
    half = np.ptp(source.output_range, axis=0) / 2
    y = source(x) + 0.2 * half
    untouched = train(x, y, (IN, OUT), Settings(iterations=0), start=source).network
    np.testing.assert_allclose(untouched(x), source(x))
    moved = train(x, y, (IN, OUT), Settings(iterations=10), start=source).network
    assert np.sqrt(np.mean(((moved(x) - y) / half) ** 2)) < 0.02
    np.testing.assert_array_equal(moved.input_range, source.input_range)
    with pytest.raises(NetworkError, match="other inputs"):
        train(x[:, :1], y, (IN[:1], OUT), start=source)
