"""Training a network: it needs torch, and is skipped visibly without it."""

import numpy as np
import pytest

from estimation.networks import training
from estimation.networks.network import NetworkError, to_unit
from estimation.networks.training import Settings, train
from tests.estimation.test_networks import IN, OUT, make

pytest.importorskip("torch", reason="torch is not installed: pip install 'rig[learn]'")


def rows(count: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform([-1.0, 0.0], [2.0, 0.5], (count, 2))


def test_the_jacobian_is_the_derivative_of_the_mapped_outputs():
    network = make()
    x = rows(6)
    found = training.jacobian(network, x)
    weights = np.concatenate([network.hidden.ravel(), network.output.ravel()])

    def mapped(w: np.ndarray) -> np.ndarray:
        moved = type(network)(
            network.inputs,
            network.outputs,
            network.input_range,
            network.output_range,
            w[: network.hidden.size].reshape(network.hidden.shape),
            w[network.hidden.size :].reshape(network.output.shape),
        )
        return to_unit(moved(x), network.output_range)

    for k in range(len(weights)):
        step = np.zeros_like(weights)
        step[k] = 1e-6
        slope = (mapped(weights + step) - mapped(weights - step)) / 2e-6
        np.testing.assert_allclose(found[:, :, k], slope, atol=1e-8)


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


def test_pure_noise_determines_hardly_any_weight():
    y = np.random.default_rng(3).normal(size=(800, 1))
    found = train(rows(800), y, (IN, OUT[:1]), Settings(nodes=8))
    assert found.effective_parameters < found.parameters / 3
    assert np.std(found.network(rows(300, 9))) < 0.25


def test_the_error_falls_with_every_block_of_rows_and_the_seed_fixes_the_result(monkeypatch):
    x = rows(900)
    y = np.sin(3 * x[:, :1]) * x[:, 1:]
    errors: list[float] = []
    settings = Settings(nodes=6, iterations=40, seed=4)
    whole = train(x, y, (IN, OUT[:1]), settings, lambda step, rmse: errors.append(rmse))
    assert len(errors) == whole.iterations
    assert errors[-1] < 0.1 * errors[0]
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
    with pytest.raises(NetworkError, match="torch is not installed"):
        train(x, y, (IN, OUT[:1]))
