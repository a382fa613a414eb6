"""Levenberg-Marquardt training with Bayesian regularisation.

The objective is F = beta E_D + alpha E_W: the sum of squared errors of the mapped outputs and the
sum of squared weights. Each accepted Levenberg-Marquardt step is followed by one evidence update:
gamma = p - alpha tr (beta J'J + alpha I)^-1, alpha = gamma / (2 E_W), beta = (n - gamma) / (2 E_D)
for p weights and n residuals. J'J is summed over blocks of rows, so memory does not grow with the
data.

Sources: D. J. C. MacKay, "Bayesian interpolation", Neural Computation 4 (1992); F. D. Foresee and
M. T. Hagan, "Gauss-Newton approximation to Bayesian learning", ICNN 1997; start of the weights
after D. Nguyen and B. Widrow, IJCNN 1990.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg.blas import dsyrk

from estimation.errors import MissingExtraError
from estimation.networks.network import Network, NetworkError, to_unit
from estimation.recording import FloatArray

if TYPE_CHECKING:
    from torch import Tensor

BLOCK = 1024
"""Rows whose derivatives are held at once: few enough to stay in a core's cache."""


@dataclass(frozen=True, slots=True)
class Settings:
    """Settings of the training."""

    nodes: int = 30
    iterations: int = 1000  # accepted steps at the most
    patience: int = 50  # converged when the error fell by less than `tolerance` over so many steps
    tolerance: float = 5e-3  # relative fall of the root mean square error
    seed: int = 0


@dataclass(frozen=True, slots=True)
class Training:
    """Result of a training."""

    network: Network
    converged: bool  # whether it stopped because nothing changed any more
    # gamma, the number of weights the data determines, of all parameters
    effective_parameters: float
    parameters: int


def has_torch() -> bool:
    """Whether torch is installed."""
    from importlib.util import find_spec

    return find_spec("torch") is not None


def require_torch() -> None:
    """Raise MissingExtraError without torch."""
    if not has_torch():
        raise MissingExtraError(
            "Training a network needs torch, which is not installed.",
            "A trained network runs without it.",
            "learn",
        )


def train(
    inputs: FloatArray,
    targets: FloatArray,
    names: tuple[Sequence[str], Sequence[str]],
    settings: Settings | None = None,
    validation: tuple[FloatArray, FloatArray] | None = None,
    start: Network | None = None,
) -> Training:
    """Train a network on all rows at once.

    Args:
        inputs: Shape (n, d).
        targets: Shape (n, o).
        names: Names of the inputs and of the outputs.
        settings: How to train; `Settings()` if None.
        validation: Further inputs and targets; the weights of the least error on them are kept.
        start: A network to train on, as in transfer learning; it keeps its ranges and its nodes.

    Raises:
        MissingExtraError: torch is not installed.
        NetworkError: A column is constant or not finite, there are too few
            rows, or the network to start from has other inputs or outputs.
    """
    require_torch()
    settings = settings or Settings()
    if start is None:
        ranges = [_range(inputs, names[0]), _range(targets, names[1])]
    else:
        if (start.inputs, start.outputs) != (tuple(names[0]), tuple(names[1])):
            raise NetworkError(
                "The network to start from has other inputs or outputs.",
                f"It has {', '.join(start.inputs)} and {', '.join(start.outputs)}.",
            )
        ranges = [start.input_range, start.output_range]
        settings = replace(settings, nodes=len(start.hidden))
    fit = _Fit(to_unit(inputs, ranges[0]), to_unit(targets, ranges[1]), settings)
    if start is not None:
        fit.start_from(start)
    if validation is not None:
        fit.hold_out(to_unit(validation[0], ranges[0]), to_unit(validation[1], ranges[1]))
    converged = fit.run()
    hidden, output = fit.weights()
    return Training(
        network=Network(tuple(names[0]), tuple(names[1]), ranges[0], ranges[1], hidden, output),
        converged=converged,
        effective_parameters=fit.gamma,
        parameters=fit.count,
    )


def _range(values: FloatArray, names: Sequence[str]) -> FloatArray:
    if values.ndim != 2 or values.shape[1] != len(names) or len(values) < 2:
        raise NetworkError(f"Rows of shape {values.shape} do not hold {len(names)} columns.")
    bounds = np.array([values.min(axis=0), values.max(axis=0)])
    bad = [n for n, w in zip(names, np.ptp(bounds, axis=0), strict=True) if not 0 < w < np.inf]
    if bad:
        raise NetworkError(
            f"A network cannot be trained on {', '.join(bad)}.",
            "The values are constant or not finite.",
        )
    return bounds


def _rows(inputs: FloatArray, targets: FloatArray) -> tuple["Tensor", "Tensor"]:
    """Return mapped rows as tensors, a one for the bias at the end of each input."""
    import torch

    x = torch.from_numpy(np.column_stack([inputs, np.ones(len(inputs))]))
    return x, torch.from_numpy(np.ascontiguousarray(targets))


def _blocks(x: "Tensor", y: "Tensor") -> Iterator[tuple["Tensor", "Tensor"]]:
    for first in range(0, len(x), BLOCK):
        yield x[first : first + BLOCK], y[first : first + BLOCK]


def _normal(
    blocks: Iterable[tuple["Tensor", "Tensor"]], hidden: "Tensor", output: "Tensor"
) -> tuple["Tensor", "Tensor"]:
    """Return J'J and J'e summed over blocks of rows.

    The derivative of output k by hidden weight (j, i) is V_kj a_j (1 - a_j) u_i, and by its output
    weights (a, 1). The part without V is the same for every output, so its products are summed
    once, and scaled by V at the end. They are symmetric, so one triangle is summed.
    """
    import torch

    count, outputs = hidden.numel(), len(output)
    nodes, wide = hidden.shape
    last = nodes + 1
    upper = np.zeros((count + last, count + last), order="F")
    slopes = torch.zeros(count + last, outputs, dtype=torch.float64)
    whole = torch.ones(BLOCK, count + last, dtype=torch.float64)  # the last column stays 1
    for x, y in blocks:
        table = whole[: len(x)]
        node = torch.sigmoid(x @ hidden.T)
        table[:, count:-1] = node
        by_hidden = table[:, :count].view(len(x), nodes, wide)
        torch.mul((node * (1 - node))[:, :, None], x[:, None, :], out=by_hidden)
        upper = dsyrk(1.0, table.numpy().T, beta=1.0, c=upper, overwrite_c=1)
        slopes.addmm_(table.T, table[:, count:] @ output.T - y)
    products = torch.from_numpy(np.triu(upper) + np.triu(upper, 1).T)
    scale = output[:, :-1].repeat_interleave(wide, dim=1)  # V_kj for each hidden weight
    curvature = torch.zeros(count + outputs * last, count + outputs * last, dtype=torch.float64)
    curvature[:count, :count] = products[:count, :count] * (scale.T @ scale)
    for k in range(outputs):
        own = slice(count + k * last, count + (k + 1) * last)
        curvature[:count, own] = products[:count, count:] * scale[k][:, None]
        curvature[own, :count] = curvature[:count, own].T
        curvature[own, own] = products[count:, count:]
    return curvature, torch.cat([(slopes[:count] * scale.T).sum(dim=1), slopes[count:].T.ravel()])


class _Fit:
    """One training: the mapped rows, the weights and the hyper-parameters."""

    FIRST_DAMPING = 1e-3  # in units of the largest curvature
    MOST_DAMPING = 1e10

    def __init__(self, inputs: FloatArray, targets: FloatArray, settings: Settings) -> None:
        import torch

        self.settings = settings
        self._x, self._y = _rows(inputs, targets)
        generator = np.random.default_rng(settings.seed)
        self._shapes = (settings.nodes, inputs.shape[1] + 1), (targets.shape[1], settings.nodes + 1)
        first = _first_weights(*self._shapes, generator)
        self._w = torch.from_numpy(np.concatenate([weights.ravel() for weights in first]))
        self.count = len(self._w)
        self.gamma = float(self.count)
        self._held_out: tuple[Tensor, Tensor] | None = None
        self._best: tuple[float, Tensor] | None = None
        self._begin()

    def start_from(self, network: Network) -> None:
        """Take a network's weights for the first ones."""
        import torch

        weights = np.concatenate([network.hidden.ravel(), network.output.ravel()])
        self._w = torch.from_numpy(weights)
        self._begin()

    def hold_out(self, inputs: FloatArray, targets: FloatArray) -> None:
        """Choose among the steps by mapped rows that are not trained on."""
        self._held_out = _rows(inputs, targets)

    def _begin(self) -> None:
        self.alpha = 0.0
        self._squares = self._error(self._w)
        self.beta = (self._y.numel() - self.count) / (2 * self._squares)
        if self.beta <= 0:
            raise NetworkError(
                f"{len(self._x)} rows are too few for {self.count} weights.",
                fix="Train on more rows, or with fewer nodes.",
            )

    @property
    def rmse(self) -> float:
        return float(np.sqrt(self._squares / self._y.numel()))

    def weights(self) -> tuple[FloatArray, FloatArray]:
        hidden, output = self._parts(self._w if self._best is None else self._best[1])
        return hidden.numpy().copy(), output.numpy().copy()

    def run(self) -> bool:
        """Train, and return whether nothing changed any more at the end."""
        self._compare()
        damping = self.FIRST_DAMPING
        history = [self.rmse]
        curvature, slope = self._normal()
        for _ in range(self.settings.iterations):
            damping = self._step(curvature, slope, damping)
            if damping > self.MOST_DAMPING:  # no step lowers the objective
                return True
            curvature, slope = self._normal()
            self._update_evidence(curvature)
            self._compare()
            history.append(self.rmse)
            if len(history) > self.settings.patience:
                before = history[-1 - self.settings.patience]
                if before - history[-1] < self.settings.tolerance * before:
                    return True
        return False

    def _compare(self) -> None:
        """Keep the weights if none before did better on the rows held out."""
        if self._held_out is not None:
            error = self._error(self._w, [self._held_out])
            if self._best is None or error < self._best[0]:
                self._best = error, self._w

    def _parts(self, w: "Tensor") -> tuple["Tensor", "Tensor"]:
        cut = self._shapes[0][0] * self._shapes[0][1]
        return w[:cut].reshape(self._shapes[0]), w[cut:].reshape(self._shapes[1])

    def _normal(self) -> tuple["Tensor", "Tensor"]:
        return _normal(_blocks(self._x, self._y), *self._parts(self._w))

    def _error(
        self, w: "Tensor", blocks: Iterable[tuple["Tensor", "Tensor"]] | None = None
    ) -> float:
        import torch

        hidden, output = self._parts(w)
        total = 0.0
        for x, y in _blocks(self._x, self._y) if blocks is None else blocks:
            estimate = torch.sigmoid(x @ hidden.T) @ output[:, :-1].T + output[:, -1]
            total += float(((estimate - y) ** 2).sum())
        return total

    def _step(self, curvature: "Tensor", slope: "Tensor", damping: float) -> float:
        """Take the first step that lowers the objective; return the damping for the next one."""
        import torch

        objective = self.beta * self._squares + self.alpha * float(self._w @ self._w)
        gradient = self.beta * slope + self.alpha * self._w
        scale = self.beta * float(curvature.diagonal().max())
        while damping <= self.MOST_DAMPING:
            damped = self.beta * curvature
            damped.diagonal().add_(self.alpha + damping * scale)
            factor, failed = torch.linalg.cholesky_ex(damped)
            if not failed:
                tried = self._w - torch.cholesky_solve(gradient[:, None], factor)[:, 0]
                squares = self._error(tried)
                if self.beta * squares + self.alpha * float(tried @ tried) < objective:
                    self._w, self._squares = tried, squares
                    return max(damping / 10, 1e-14)
            damping *= 4
        return damping

    def _update_evidence(self, curvature: "Tensor") -> None:
        import torch

        values = torch.linalg.eigvalsh(curvature).clamp(min=0) * self.beta
        if self.alpha > 0:
            self.gamma = float((values / (values + self.alpha)).sum())
        self.alpha = self.gamma / (2 * float(self._w @ self._w))
        self.beta = (self._y.numel() - self.gamma) / (2 * max(self._squares, 1e-300))


def _first_weights(
    hidden: tuple[int, int], output: tuple[int, int], generator: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Return weights that spread the nodes' slopes over [-1, 1] (Nguyen and Widrow 1990)."""
    nodes, wide = hidden[0], hidden[1] - 1
    direction = generator.uniform(-1, 1, (nodes, wide))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    # a logistic node is as steep as a tanh node of half the weight
    size = 2 * 0.7 * nodes ** (1 / wide)
    bias = size * np.linspace(-1, 1, nodes) * np.sign(generator.uniform(-1, 1, nodes))
    return np.column_stack([size * direction, bias]), generator.uniform(-0.5, 0.5, output)
