"""The networks of saved attackers: what they look like, and their forward pass on any array library."""

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from math import prod
from typing import Annotated, Any, Literal, Protocol, Self

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Field, model_validator

from roletrust_env.arrays import Array, namespace

MAX_WEIGHTS = 4_000_000
"""A network with more weights than this is no attacker of these games."""

_MAX_WORK = 100 * MAX_WEIGHTS
"""Multiplications of a decision: a network of heads uses its weights many times."""

_CLIP = 10.0  # standard deviations beyond which an input says nothing more

Floats = npt.NDArray[np.float32]
Width = Annotated[int, Field(ge=1, le=4096)]
Place = Annotated[int, Field(ge=0, lt=100_000)]
_STRICT = ConfigDict(frozen=True, strict=True, extra="forbid", allow_inf_nan=False)


class Head(BaseModel):
    """A small network that is asked for several outputs, of each by what concerns it. The first layer is told which."""

    model_config = _STRICT

    outputs: Annotated[tuple[Place, ...], Field(min_length=1, max_length=10_000)]
    """Where its outputs stand among all."""
    sees: Annotated[tuple[tuple[Place, ...], ...], Field(max_length=10_000)]
    """For each of them the inputs that it sees, as many for one as for the other."""


class Architecture(BaseModel):
    """Normalised inputs -> LSTM, if any -> hidden layers -> outputs in [-1, 1] -> actions in [0, 1].

    One network leads from all inputs to all outputs; or several heads, each with hidden layers of its own.
    """

    model_config = _STRICT

    inputs: Annotated[int, Field(ge=1, le=100_000)]
    """K, the size of an observation."""
    outputs: Annotated[int, Field(ge=1, le=10_000)]
    """A, the size of an action."""
    hidden: Annotated[tuple[Width, ...], Field(max_length=8)]
    """Units of each hidden layer."""
    activation: Literal["tanh", "relu"] = "tanh"
    """Of the hidden layers."""
    squash: Literal["clip", "tanh"] = "clip"
    """How an output comes to lie in [-1, 1]."""
    lstm: Annotated[int, Field(ge=0, le=4096)] = 0
    """Units of the LSTM; 0 is none, and no memory."""
    heads: Annotated[tuple[Head, ...], Field(max_length=100)] = ()
    """Which share the outputs among them; none is one network for all."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.heads:
            self._check_heads()
        if (total := sum(prod(shape) for shape in self.shapes().values())) > MAX_WEIGHTS:
            raise ValueError(f"the network has {total} weights; there can be {MAX_WEIGHTS}")
        return self

    def _check_heads(self) -> None:
        if self.lstm or not self.hidden:
            raise ValueError("heads have hidden layers and no LSTM")
        if sorted(place for head in self.heads for place in head.outputs) != list(range(self.outputs)):
            raise ValueError(f"each of the {self.outputs} outputs must be that of one head")
        for head in self.heads:
            if len(head.sees) != len(head.outputs) or len({len(seen) for seen in head.sees}) != 1 or not head.sees[0]:
                raise ValueError("a head must see as many inputs, 1 or more, for each of its outputs")
            if max(max(seen) for seen in head.sees) >= self.inputs:
                raise ValueError(f"a head sees what is none of the {self.inputs} inputs")
        work = sum(len(head.outputs) * sum(map(prod, self._head(h).values())) for h, head in enumerate(self.heads))
        if work > _MAX_WORK:
            raise ValueError(f"the heads take {work} multiplications; there can be {_MAX_WORK}")

    def shapes(self) -> dict[str, tuple[int, ...]]:
        """The names and shapes of the weights; those of the LSTM are as torch has them, gates i, f, g, o."""
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
        """The weights of a head; `own` is added to the first layer, for each output its own."""
        head = self.heads[h]
        own = {f"head{h}.own": (len(head.outputs), self.hidden[0])}
        return own | _layers(f"head{h}.", (len(head.sees[0]), *self.hidden, 1))


class Decider(Protocol):
    """A function from observations to actions, with a memory where it needs one."""

    @property
    def has_memory(self) -> bool:
        """Whether it remembers anything from round to round."""
        ...

    def begin(self, like: Array) -> Any:
        """Return the memory before the first observation, for `like` of the shape of the batch."""
        ...

    def __call__(self, observation: Array, memory: Any = None) -> tuple[Array, Any]:
        """Return the actions in [0, 1], (A, ...), for observations, (K, ...), and the new memory."""
        ...


class Network:
    """A network, as a function from observations to actions. It holds the batch last, like everything else.

    Args:
        architecture: its shape.
        mean: of each input, (K,), subtracted before the first layer.
        variance: of each input, (K,), whose root divides it then.
        weights: as `Architecture.shapes` names and shapes them, float32.

    Raises:
        ValueError: a weight is missing, superfluous, of the wrong shape or dtype, or not finite.
    """

    def __init__(
        self, architecture: Architecture, mean: Floats, variance: Floats, weights: Mapping[str, Floats]
    ) -> None:
        shapes = architecture.shapes()
        if set(weights) != set(shapes):
            raise ValueError(f"the weights are {sorted(weights)}; the architecture has {sorted(shapes)}")
        for name, shape in shapes.items():
            found = weights[name]
            if found.shape != shape or found.dtype != np.float32:
                raise ValueError(f"weight {name!r} is {found.dtype} of shape {found.shape}; needed is float32, {shape}")
            if not np.isfinite(found).all():
                raise ValueError(f"weight {name!r} holds NaN or infinity")
        if mean.shape != (architecture.inputs,) or variance.shape != (architecture.inputs,):
            raise ValueError(f"mean and variance must have one entry for each of the {architecture.inputs} inputs")
        self.architecture = architecture
        self.mean, self.variance = mean, variance
        self.weights = dict(weights)
        self._order = np.argsort([place for head in architecture.heads for place in head.outputs]).tolist()

    @property
    def has_memory(self) -> bool:
        """Whether there is an LSTM."""
        return self.architecture.lstm > 0

    def begin(self, like: Array) -> Array | None:
        """The memory before the first observation: (2 H, ...) for `like` of shape (...); None without an LSTM."""
        if not self.architecture.lstm:
            return None
        return namespace(like).stack([0 * like] * (2 * self.architecture.lstm))

    def __call__(self, observation: Array, memory: Array | None = None) -> tuple[Array, Array | None]:
        """Actions in [0, 1], shape (A, ...), for observations of shape (K, ...); and the new memory."""
        xp, batch = namespace(observation), tuple(observation.shape[1:])
        if observation.shape[0] != self.architecture.inputs:
            raise ValueError(f"the observation has {observation.shape[0]} entries, not {self.architecture.inputs}")

        def constant(values: Floats) -> Array:
            return values if xp is np else xp.asarray(values, dtype=observation.dtype, device=observation.device)

        x = observation.reshape(observation.shape[0], -1)
        x = (x - constant(self.mean)[:, None]) / constant(np.sqrt(self.variance))[:, None]
        x = xp.clip(x, -_CLIP, _CLIP)
        if self.architecture.lstm:
            if memory is None:
                raise ValueError("the network has a memory; give that of `begin` at first")
            parts = [constant(self.weights[f"lstm.{name}"]) for name in ("input", "hidden", "bias")]
            x, memory = _lstm(xp, parts, x, memory.reshape(2 * self.architecture.lstm, -1))
            memory = memory.reshape(-1, *batch)
        if self.architecture.heads:
            heads = enumerate(self.architecture.heads)
            rows = [self._layers(f"head{h}.", x[xp.asarray(head.sees)], constant)[:, 0] for h, head in heads]
            x = xp.concat(rows)[self._order]
        else:
            x = self._layers("", x, constant)
        x = xp.tanh(x) if self.architecture.squash == "tanh" else xp.clip(x, -1.0, 1.0)
        return (x * 0.5 + 0.5).reshape(-1, *batch), memory

    def _layers(self, name: str, x: Array, constant: Callable[[Floats], Array]) -> Array:
        """The layers of a head, (n, k, B) -> (n, 1, B), or of the one network, (K, B) -> (A, B)."""
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
    """The names and shapes of the weights of layers with these numbers of units, the inputs first."""
    shapes: dict[str, tuple[int, ...]] = {}
    for i, (inputs, units) in enumerate(pairwise(widths)):
        shapes[f"{name}layer{i}.weight"], shapes[f"{name}layer{i}.bias"] = (units, inputs), (units,)
    return shapes


def _lstm(xp: Any, weights: list[Array], x: Array, memory: Array) -> tuple[Array, Array]:
    """One step of an LSTM (Hochreiter and Schmidhuber, 1997): its output; hidden above cell state."""
    of_input, of_hidden, bias = weights
    units = of_hidden.shape[1]
    gates = of_input @ x + of_hidden @ memory[:units] + bias[:, None]
    enter, keep, new, show = (gates[k * units : (k + 1) * units] for k in range(4))
    cell = _sigmoid(xp, keep) * memory[units:] + _sigmoid(xp, enter) * xp.tanh(new)
    hidden = _sigmoid(xp, show) * xp.tanh(cell)
    return hidden, xp.concat([hidden, cell])


def _sigmoid(xp: Any, x: Array) -> Array:
    return 0.5 * xp.tanh(0.5 * x) + 0.5  # has no overflow
