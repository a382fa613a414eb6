"""Networks: training recovers a known function; prediction and files need no torch."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimation.networks import network as net
from estimation.networks.network import Network, NetworkError

IN, OUT = ("spindle_angle_rad", "motor_current_a"), ("proximal_torque_n_m", "jaw_angle_rad")

LAYOUT = "rig.network/1"


def make(nodes: int = 4, wide: int = 2, outputs: int = 2, seed: int = 0) -> Network:
    draw = np.random.default_rng(seed)
    return Network(
        IN[:wide],
        OUT[:outputs],
        np.array([[-1.0, 0.0], [2.0, 0.5]])[:, :wide],
        np.array([[-0.1, 0.0], [0.4, 1.0]])[:, :outputs],
        draw.normal(size=(nodes, wide + 1)),
        draw.normal(size=(outputs, nodes + 1)),
    )


@given(st.integers(1, 9), st.integers(0, 1000))
def test_each_output_is_the_written_equation(nodes, seed):
    network = make(nodes, seed=seed)
    x = np.array([0.3, 0.2])
    u = 2 * (x - network.input_range[0]) / np.ptp(network.input_range, axis=0) - 1
    a = 1 / (1 + np.exp(-(network.hidden[:, :2] @ u + network.hidden[:, 2])))
    v = network.output[:, :-1] @ a + network.output[:, -1]
    y = network.output_range[0] + (v + 1) * np.ptp(network.output_range, axis=0) / 2
    np.testing.assert_allclose(network(x)[0], y, rtol=1e-12)


def test_inputs_outside_the_range_are_flagged_and_nan_stays_nan():
    network = make()
    rows = np.array([[0.0, 0.2], [3.0, 0.2], [np.nan, 0.2]])
    assert network.inside(rows).tolist() == [True, False, False]
    assert np.isfinite(network(rows)).all(axis=1).tolist() == [True, True, False]
    with pytest.raises(NetworkError, match="takes 2 inputs, not 3"):
        network(np.zeros((1, 3)))


def test_a_file_gives_the_same_network_back(tmp_path):
    network = make()
    path = tmp_path / "deep" / "network.npz"
    net.write_arrays(path, LAYOUT, net.to_arrays(network))
    again = net.from_arrays(net.read_arrays(path, LAYOUT))
    rows = np.random.default_rng(1).uniform(-1, 1, (50, 2))
    np.testing.assert_array_equal(again(rows), network(rows))
    assert (again.inputs, again.outputs) == (network.inputs, network.outputs)


def test_a_damaged_foreign_or_pickled_file_is_refused(tmp_path):
    path = tmp_path / "network.npz"
    with pytest.raises(NetworkError, match="cannot be read"):
        net.read_arrays(path, LAYOUT)
    net.write_arrays(path, LAYOUT, net.to_arrays(make()))
    path.write_bytes(path.read_bytes()[:300])
    with pytest.raises(NetworkError, match="cannot be read"):
        net.read_arrays(path, LAYOUT)
    np.savez(path, schema=np.array(LAYOUT), hidden=np.array([{}], dtype=object))
    with pytest.raises(NetworkError, match="cannot be read"):
        net.read_arrays(path, LAYOUT)
    np.savez(path, hidden=np.zeros(3))
    with pytest.raises(NetworkError, match="layout none"):
        net.read_arrays(path, LAYOUT)
    arrays = net.to_arrays(make())
    del arrays["hidden"]
    with pytest.raises(NetworkError, match="'hidden' of a network is missing"):
        net.from_arrays(arrays)
    with pytest.raises(NetworkError, match="must be"):
        net.from_arrays({**arrays, "hidden": np.zeros((4, 9))})
