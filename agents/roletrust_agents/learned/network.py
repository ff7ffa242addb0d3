"""Networks of saved attackers: their architecture, and their forward pass on any array library."""

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from math import prod
from typing import Annotated, Any, Literal, Protocol, Self

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Field, model_validator

from roletrust_env.arrays import Array, namespace

MAX_WEIGHTS = 4_000_000
"""Largest number of weights of a network."""

_MAX_WORK = 100 * MAX_WEIGHTS
"""Largest number of multiplications in a decision. A network with heads uses its weights several
times."""

_CLIP = 10.0  # limit on normalised inputs, in standard deviations

Floats = npt.NDArray[np.float32]
Width = Annotated[int, Field(ge=1, le=4096)]
Place = Annotated[int, Field(ge=0, lt=100_000)]
_STRICT = ConfigDict(frozen=True, strict=True, extra="forbid", allow_inf_nan=False)


class Head(BaseModel):
    """Small network that is applied once for each of several outputs, with the inputs that concern
    this output.

    A learned vector for each output is added to the first layer.
    """

    model_config = _STRICT

    outputs: Annotated[tuple[Place, ...], Field(min_length=1, max_length=10_000)]
    """Indices of its outputs among all outputs."""
    sees: Annotated[tuple[tuple[Place, ...], ...], Field(max_length=10_000)]
    """Indices of the inputs for each of its outputs, the same number for all."""


class Architecture(BaseModel):
    """Architecture: normalised inputs -> optional LSTM -> hidden layers -> outputs in [-1, 1] ->
    actions in [0, 1].

    There is either one network from all inputs to all outputs, or several heads with hidden layers
    of their own.
    """

    model_config = _STRICT

    inputs: Annotated[int, Field(ge=1, le=100_000)]
    """Size of an observation, K."""
    outputs: Annotated[int, Field(ge=1, le=10_000)]
    """Size of an action, A."""
    hidden: Annotated[tuple[Width, ...], Field(max_length=8)]
    """Number of units of each hidden layer."""
    activation: Literal["tanh", "relu"] = "tanh"
    """Activation function of the hidden layers."""
    squash: Literal["clip", "tanh"] = "clip"
    """Function that maps the outputs to [-1, 1]."""
    lstm: Annotated[int, Field(ge=0, le=4096)] = 0
    """Number of units of the LSTM; 0 is a network without LSTM and without memory."""
    heads: Annotated[tuple[Head, ...], Field(max_length=100)] = ()
    """Heads, each of which has some of the outputs; empty for one network with all outputs."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.heads:
            self._check_heads()
        if (total := sum(prod(shape) for shape in self.shapes().values())) > MAX_WEIGHTS:
            raise ValueError(f"the network has {total} weights; the limit is {MAX_WEIGHTS}")
        return self

    def _check_heads(self) -> None:
        if self.lstm or not self.hidden:
            raise ValueError("a network with heads must have hidden layers and no LSTM")
        if sorted(index for head in self.heads for index in head.outputs) != list(
            range(self.outputs)
        ):
            raise ValueError(f"each of the {self.outputs} outputs must belong to exactly one head")
        for head in self.heads:
            sizes = {len(inputs) for inputs in head.sees}
            if len(head.sees) != len(head.outputs) or len(sizes) != 1 or not head.sees[0]:
                raise ValueError(
                    "a head must have the same number of inputs, 1 or more, for each of its outputs"
                )
            if max(max(inputs) for inputs in head.sees) >= self.inputs:
                raise ValueError(
                    f"an input of a head is not one of the {self.inputs} inputs of the network"
                )
        work = sum(
            len(head.outputs) * sum(map(prod, self._head(h).values()))
            for h, head in enumerate(self.heads)
        )
        if work > _MAX_WORK:
            raise ValueError(f"the heads take {work} multiplications; the limit is {_MAX_WORK}")

    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Return the shape of each weight by its name. The gates of the LSTM are in the order of
        torch: i, f, g, o.
        """
        shapes: dict[str, tuple[int, ...]] = {}
        if self.heads:
            for h in range(len(self.heads)):
                shapes |= self._head(h)
            return shapes
        width = self.inputs
        if self.lstm:
            shapes["lstm.input"] = (4 * self.lstm, width)
            shapes["lstm.hidden"] = (4 * self.lstm, self.lstm)
            shapes["lstm.bias"] = (4 * self.lstm,)
            width = self.lstm
        return shapes | _layers("", (width, *self.hidden, self.outputs))

    def _head(self, h: int) -> dict[str, tuple[int, ...]]:
        """Return the shapes of the weights of a head. `own` holds the vector of each output for the
        first layer.
        """
        head = self.heads[h]
        own = {f"head{h}.own": (len(head.outputs), self.hidden[0])}
        return own | _layers(f"head{h}.", (len(head.sees[0]), *self.hidden, 1))


class Decider(Protocol):
    """A function from observations to actions, with a memory where it needs one."""

    @property
    def has_memory(self) -> bool:
        """True if there is a memory from round to round."""

    def begin(self, like: Array) -> Any:
        """Return the memory before the first observation, for `like` of the shape of the batch."""

    def __call__(self, observation: Array, memory: Any = None) -> tuple[Array, Any]:
        """Return the actions in [0, 1], (A, ...), for observations, (K, ...), and the new
        memory.
        """


class Network:
    """Network, a function from observations to actions, with the batch in the last axes.

    Args:
        architecture: Architecture.
        mean: Mean of each input, shape (K,), which the normalisation subtracts.
        variance: Variance of each input, shape (K,), by whose square root the normalisation then
            divides.
        weights: Weights with the names and shapes of `Architecture.shapes`, float32.

    Raises:
        ValueError: A weight is missing, superfluous, of the wrong shape or dtype, or not finite.
    """

    def __init__(
        self,
        architecture: Architecture,
        mean: Floats,
        variance: Floats,
        weights: Mapping[str, Floats],
    ) -> None:
        shapes = architecture.shapes()
        if set(weights) != set(shapes):
            raise ValueError(
                f"the weights are {sorted(weights)}; the architecture has {sorted(shapes)}"
            )
        for name, shape in shapes.items():
            weight = weights[name]
            if weight.shape != shape or weight.dtype != np.float32:
                raise ValueError(
                    f"weight {name!r} is {weight.dtype} of shape {weight.shape}; it must be "
                    f"float32 of shape {shape}"
                )
            if not np.isfinite(weight).all():
                raise ValueError(f"weight {name!r} holds NaN or infinity")
        if mean.shape != (architecture.inputs,) or variance.shape != (architecture.inputs,):
            raise ValueError(
                f"mean and variance must have one entry for each of the {architecture.inputs} "
                "inputs"
            )
        self.architecture = architecture
        self.mean, self.variance = mean, variance
        self.weights = dict(weights)
        self._order = np.argsort(
            [place for head in architecture.heads for place in head.outputs]
        ).tolist()

    @property
    def has_memory(self) -> bool:
        """True if there is an LSTM."""
        return self.architecture.lstm > 0

    def begin(self, like: Array) -> Array | None:
        """Return the memory before the first observation, shape (2 H, ...); None without an LSTM.

        Args:
            like: Array of the shape of the batch (...), of the library, dtype and device to work
                with.
        """
        if not self.architecture.lstm:
            return None
        return namespace(like).stack([0 * like] * (2 * self.architecture.lstm))

    def __call__(
        self, observation: Array, memory: Array | None = None
    ) -> tuple[Array, Array | None]:
        """Return actions in [0, 1], shape (A, ...), for observations of shape (K, ...), and the new
        memory.
        """
        xp, batch = namespace(observation), tuple(observation.shape[1:])
        if observation.shape[0] != self.architecture.inputs:
            raise ValueError(
                f"the observation has {observation.shape[0]} entries, not "
                f"{self.architecture.inputs}"
            )

        def constant(values: Floats) -> Array:
            return (
                values
                if xp is np
                else xp.asarray(values, dtype=observation.dtype, device=observation.device)
            )

        x = observation.reshape(observation.shape[0], -1)
        x = (x - constant(self.mean)[:, None]) / constant(np.sqrt(self.variance))[:, None]
        x = xp.clip(x, -_CLIP, _CLIP)
        if self.architecture.lstm:
            if memory is None:
                raise ValueError("the network has a memory; the first one is that of `begin`")
            parts = [constant(self.weights[f"lstm.{name}"]) for name in ("input", "hidden", "bias")]
            x, memory = _lstm(xp, parts, x, memory.reshape(2 * self.architecture.lstm, -1))
            memory = memory.reshape(-1, *batch)
        if self.architecture.heads:
            heads = enumerate(self.architecture.heads)
            rows = [
                self._layers(f"head{h}.", x[xp.asarray(head.sees)], constant)[:, 0]
                for h, head in heads
            ]
            x = xp.concat(rows)[self._order]
        else:
            x = self._layers("", x, constant)
        x = xp.tanh(x) if self.architecture.squash == "tanh" else xp.clip(x, -1.0, 1.0)
        return (x * 0.5 + 0.5).reshape(-1, *batch), memory

    def _layers(self, name: str, x: Array, constant: Callable[[Floats], Array]) -> Array:
        """Apply the layers of a head, (n, k, B) -> (n, 1, B), or of a network without heads, (K, B)
        -> (A, B).
        """
        xp, last = namespace(x), len(self.architecture.hidden)
        for i in range(last + 1):
            x = (
                constant(self.weights[f"{name}layer{i}.weight"]) @ x
                + constant(self.weights[f"{name}layer{i}.bias"])[:, None]
            )
            if i == 0 and name:
                x = x + constant(self.weights[f"{name}own"])[..., None]
            if i < last:
                x = xp.tanh(x) if self.architecture.activation == "tanh" else xp.clip(x, 0.0, None)
        return x


def _layers(name: str, widths: Sequence[int]) -> dict[str, tuple[int, ...]]:
    """Return the shapes of the weights of dense layers. The widths are the number of inputs, then
    of the units.
    """
    shapes: dict[str, tuple[int, ...]] = {}
    for i, (inputs, units) in enumerate(pairwise(widths)):
        shapes[f"{name}layer{i}.weight"], shapes[f"{name}layer{i}.bias"] = (units, inputs), (units,)
    return shapes


def _lstm(xp: Any, weights: list[Array], x: Array, memory: Array) -> tuple[Array, Array]:
    """Return the output of one step of an LSTM (Hochreiter and Schmidhuber, 1997), and its hidden
    and cell state.
    """
    input_weights, hidden_weights, bias = weights
    units = hidden_weights.shape[1]
    gates = input_weights @ x + hidden_weights @ memory[:units] + bias[:, None]
    i, f, g, o = (gates[k * units : (k + 1) * units] for k in range(4))
    cell = _sigmoid(xp, f) * memory[units:] + _sigmoid(xp, i) * xp.tanh(g)
    hidden = _sigmoid(xp, o) * xp.tanh(cell)
    return hidden, xp.concat([hidden, cell])


def _sigmoid(xp: Any, x: Array) -> Array:
    return 0.5 * xp.tanh(0.5 * x) + 0.5  # does not overflow
