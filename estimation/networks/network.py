"""A network with one logistic hidden layer: weights, prediction in NumPy, and its file."""

import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import expit

from estimation.errors import EstimationError
from estimation.file_kinds import ARRAYS, ESTIMATOR, kind_of
from estimation.files import write_bytes_atomic
from estimation.recording import FloatArray, read_only


class NetworkError(EstimationError):
    """A network's arrays, its inputs or its file do not fit together."""


@dataclass(frozen=True, eq=False)
class Network:
    """A network with one logistic hidden layer and a linear output.

    Equation: u = 2 (x - x_low) / (x_high - x_low) - 1, a = 1 / (1 + exp(-(W u + c))),
    v = V a + d, y = y_low + (v + 1) (y_high - y_low) / 2: inputs and outputs are mapped to [-1, 1]
    over the range they were trained on.

    Source: O'Neill et al. 2018, section II.D, with 30 hidden nodes.
    """

    inputs: tuple[str, ...]  # names of the inputs, d of them
    outputs: tuple[str, ...]  # names of the outputs, o of them
    input_range: FloatArray  # lowest and highest input trained on, shape (2, d)
    output_range: FloatArray  # lowest and highest output trained on, shape (2, o)
    hidden: FloatArray  # weights of the hidden layer, the bias last, shape (nodes, d + 1)
    output: FloatArray  # weights of the output layer, the bias last, shape (o, nodes + 1)

    def __post_init__(self) -> None:
        wide, nodes = len(self.inputs), len(self.hidden)
        shapes = {
            "input_range": (2, wide),
            "output_range": (2, len(self.outputs)),
            "hidden": (nodes, wide + 1),
            "output": (len(self.outputs), nodes + 1),
        }
        for name, shape in shapes.items():
            values = read_only(getattr(self, name))
            if values.shape != shape or not np.isfinite(values).all():
                raise NetworkError(
                    f"The network's {name} has shape {values.shape} or values that are not finite.",
                    f"It must be {shape} and finite.",
                )
            object.__setattr__(self, name, values)

    def __call__(self, rows: ArrayLike) -> FloatArray:
        """Return the outputs, shape (n, o), for inputs of shape (n, d) in their own units.

        An input that is not finite gives outputs that are not; errors are those of `nodes`.
        """
        nodes = self.nodes(rows)
        return from_unit(nodes @ self.output[:, :-1].T + self.output[:, -1], self.output_range)

    def nodes(self, rows: ArrayLike) -> FloatArray:
        """Return the hidden layer's outputs, shape (n, nodes).

        Raises:
            NetworkError: The rows have another number of columns.
        """
        x = np.atleast_2d(np.asarray(rows, dtype=np.float64))
        if x.shape[1] != len(self.inputs):
            raise NetworkError(
                f"The network takes {len(self.inputs)} inputs, not {x.shape[1]}.",
                f"They are: {', '.join(self.inputs)}.",
            )
        unit = to_unit(x, self.input_range)
        nodes: FloatArray = expit(unit @ self.hidden[:, :-1].T + self.hidden[:, -1])
        return nodes

    def inside(self, rows: ArrayLike) -> np.ndarray:
        """Return which rows, shape (n, d), have every input in the training range, shape (n,)."""
        x = np.atleast_2d(np.asarray(rows, dtype=np.float64))
        inside: np.ndarray = np.all((x >= self.input_range[0]) & (x <= self.input_range[1]), axis=1)
        return inside


def to_unit(values: FloatArray, bounds: FloatArray) -> FloatArray:
    """Map values, shape (n, k), so that bounds, shape (2, k), come to -1 and 1."""
    mapped: FloatArray = 2 * (values - bounds[0]) / (bounds[1] - bounds[0]) - 1
    return mapped


def from_unit(values: FloatArray, bounds: FloatArray) -> FloatArray:
    """Undo `to_unit`."""
    mapped: FloatArray = bounds[0] + (values + 1) * (bounds[1] - bounds[0]) / 2
    return mapped


def to_arrays(network: Network) -> dict[str, np.ndarray]:
    """Return a network as named arrays; `from_arrays` gives it back."""
    names = ("input_range", "output_range", "hidden", "output")
    return {
        "inputs": np.array(network.inputs),
        "outputs": np.array(network.outputs),
        **{name: getattr(network, name) for name in names},
    }


def from_arrays(arrays: dict[str, np.ndarray]) -> Network:
    """Return the network of named arrays; NetworkError where one is missing or does not fit."""
    try:
        return Network(
            tuple(str(name) for name in arrays["inputs"]),
            tuple(str(name) for name in arrays["outputs"]),
            *(arrays[name] for name in ("input_range", "output_range", "hidden", "output")),
        )
    except KeyError as error:
        raise NetworkError(f"The array {error} of a network is missing.") from error


def write_arrays(path: Path, schema: str, arrays: dict[str, np.ndarray]) -> None:
    """Write named arrays and the name of their layout as NPZ."""
    content = io.BytesIO()
    np.savez(content, allow_pickle=False, schema=np.array(schema), **arrays)
    write_bytes_atomic(path, content.getvalue())


def read_arrays(path: Path, schema: str) -> dict[str, np.ndarray]:
    """Read what `write_arrays` wrote.

    Raises:
        NetworkError: The file is missing, damaged, or of another layout.
    """
    arrays, found = _content(path)
    if found != schema:
        raise NetworkError(
            f"The file {path} has the layout {found}, not {schema}.",
            "It is of another kind, or another version of rig wrote it.",
            "Fit it again: rig fit PATH --model states --out FILE.npz, or --model network.",
        )
    return arrays


def schema_of(path: Path) -> str:
    """Return the name of the layout that `write_arrays` wrote; NetworkError where it is damaged."""
    return _content(path)[1]


def _content(path: Path) -> tuple[dict[str, np.ndarray], str]:
    try:
        content = path.read_bytes()
    except OSError as error:
        raise NetworkError(
            f"The file {path} cannot be read.", f"{error.strerror or error}.", "Check the path."
        ) from error
    try:
        with np.load(io.BytesIO(content), allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
    except Exception as error:  # a damaged archive raises one of many
        kind = kind_of(content)
        raise NetworkError(
            f"The file {path} cannot be read as an estimator.",
            "It is damaged." if kind in (ESTIMATOR, ARRAYS) else f"It is {kind}.",
            "Name a file that rig fit or rig adapt wrote, .toml or .npz.",
        ) from error
    return arrays, str(arrays.pop("schema", "none"))
