"""The network of a coalition: it treats all providers alike, so that it plays with any number of them."""

from collections.abc import Mapping
from math import prod
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from roletrust_env.arrays import Array, cast, namespace
from roletrust_env.game.coalition import FEATURES, IDENTITY_FEATURES

UNITS = 12
"""Number of units of each layer, unless another is given."""

_IDENTITY_UNITS = 6

GAIN = 3.0
"""Factor of the last layer: the best lies and qualities are often all or nothing."""


class DeepSetArchitecture(BaseModel):
    """Architecture of a `DeepSet`: two layers for each provider, of which the second sees the mean over providers."""

    model_config = ConfigDict(frozen=True, strict=True, extra="forbid")

    kind: Literal["deep-set"] = "deep-set"
    units: Annotated[int, Field(ge=1, le=256)] = UNITS
    """Number of units of each layer."""
    features: tuple[str, ...] = FEATURES
    """Names of the features of a provider."""
    identity_features: tuple[str, ...] = IDENTITY_FEATURES
    """Names of the features of an identity."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if (self.features, self.identity_features) != (FEATURES, IDENTITY_FEATURES):
            raise ValueError("the features are not those of this version of the package")
        return self

    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Return the shape of each weight by its name."""
        units, seen, known = self.units, len(self.features), len(self.identity_features)
        return {
            "layer0.weight": (units, seen),
            "layer0.bias": (units,),
            "layer1.weight": (units, units),
            "layer1.mean": (units, units),
            "layer1.bias": (units,),
            "layer2.weight": (3, units),
            "layer2.skip": (3, seen),
            "layer2.bias": (3,),
            "presence0.weight": (_IDENTITY_UNITS, known),
            "presence0.bias": (_IDENTITY_UNITS,),
            "presence1.weight": (1, _IDENTITY_UNITS),
            "presence1.bias": (1,),
        }

    @property
    def size(self) -> int:
        """Number of weights."""
        return sum(map(prod, self.shapes().values()))


class DeepSet:
    """Network from the features of providers to the decision of a coalition, after Zaheer et al. (2017).

    For each provider i with features x_i: u_i = tanh(A x_i + a), v_i = tanh(B u_i + C mean_j u_j + b), and
    (l_i, q_i, g_i) = 0.5 + 0.5 tanh(3 (D v_i + E x_i + d)). The decision is the lie 0.5 + g_i (l_i - 0.5), of which 0.5
    is the truth, and the quality q_i if the provider is an accomplice. The gate g_i lets a liar tell the truth most of
    the time, and so keep its trust. A second, smaller network decides for each identity in reserve whether it shall be
    present.

    K networks of one architecture play side by side in a batch of shape (K, G).

    Args:
        architecture: Architecture.
        weights: Weights by the names of `DeepSetArchitecture.shapes`, each with one further axis K in front, or
            without it for a single network.

    Raises:
        ValueError: A weight is missing, superfluous, of the wrong shape, or not finite.
    """

    def __init__(self, architecture: DeepSetArchitecture, weights: Mapping[str, Array]) -> None:
        shapes = architecture.shapes()
        if set(weights) != set(shapes):
            raise ValueError(f"the weights are {sorted(weights)}; the architecture has {sorted(shapes)}")
        rows = weights["layer2.bias"].shape[:-1]
        for name, shape in shapes.items():
            found = tuple(weights[name].shape)
            if len(rows) > 1 or found != (*rows, *shape):
                raise ValueError(f"weight {name!r} has the shape {found}; the architecture has {shape}")
            if not bool(namespace(weights[name]).isfinite(weights[name]).all()):
                raise ValueError(f"weight {name!r} has entries that are not finite")
        self.architecture = architecture
        self.weights = dict(weights)

    @classmethod
    def unflatten(cls, architecture: DeepSetArchitecture, vector: Array) -> Self:
        """Return the network with its weights in a vector, shape (n,), or K networks, shape (K, n)."""
        weights, at = {}, 0
        for name, shape in architecture.shapes().items():
            weights[name] = vector[..., at : at + prod(shape)].reshape(*vector.shape[:-1], *shape)
            at += prod(shape)
        return cls(architecture, weights)

    def flatten(self) -> Array:
        """Return the weights as a vector, shape (n,), or (K, n) for K networks."""
        shapes = self.architecture.shapes()
        parts = [self.weights[name].reshape(*self.weights[name].shape[: -len(s)], -1) for name, s in shapes.items()]
        return namespace(parts[0]).concat(parts, axis=-1)

    def decide(self, features: Array) -> Array:
        """Return lies and qualities, shape (2, P, ...), in [0, 1], from features, shape (F, P, ...)."""
        seen, own = self._rows(features), self._constants(features)
        xp, (k, _, cells) = namespace(features), seen.shape
        p = features.shape[1]
        x = xp.tanh(own["layer0.weight"] @ seen + own["layer0.bias"][..., None])
        pooled = own["layer1.mean"] @ x.reshape(k, -1, p, cells // p).mean(axis=2)
        x = (own["layer1.weight"] @ x).reshape(k, -1, p, cells // p) + pooled[:, :, None, :]
        x = xp.tanh(x + own["layer1.bias"][..., None, None]).reshape(k, -1, cells)
        x = own["layer2.weight"] @ x + own["layer2.skip"] @ seen + own["layer2.bias"][..., None]
        lie, quality, gate = self._decisions(GAIN * x, features)
        return xp.stack([0.5 + (lie - 0.5) * gate, quality])

    def presence(self, features: Array) -> Array:
        """Return whether each identity shall be present, boolean, shape (n, ...), from features, shape (I, n, ...)."""
        x, own = self._rows(features), self._constants(features)
        x = namespace(features).tanh(own["presence0.weight"] @ x + own["presence0.bias"][..., None])
        return self._decisions(own["presence1.weight"] @ x + own["presence1.bias"][..., None], features)[0] > 0.5

    def _rows(self, features: Array) -> Array:
        """Return features as K matrices, (K, F, P * G). One network sees the whole batch as one row."""
        xp, (f, p, *batch) = namespace(features), features.shape
        if self.weights["layer2.bias"].ndim == 1:
            return features.reshape(1, f, -1)
        k = batch[0]
        return xp.moveaxis(features.reshape(f, p, k, -1), 2, 0).reshape(k, f, -1)

    def _decisions(self, outputs: Array, features: Array) -> Array:
        """Return outputs, (K, O, P * G), as decisions in [0, 1] of shape (O, P, ...)."""
        xp, (k, o, _), (_, p, *batch) = namespace(outputs), outputs.shape, features.shape
        rows = xp.moveaxis(outputs.reshape(k, o, p, -1), 0, 2)
        return (0.5 + 0.5 * xp.tanh(rows)).reshape(o, p, *batch)

    def _constants(self, like: Array) -> dict[str, Array]:
        """Return the weights in the array library, dtype and device of an array."""
        first = self.weights["layer2.bias"]
        if type(first) is type(like):
            same = {name: w if w.dtype == like.dtype else cast(w, like.dtype) for name, w in self.weights.items()}
        else:
            xp = namespace(like)
            same = {name: xp.asarray(w, dtype=like.dtype, device=like.device) for name, w in self.weights.items()}
        return same


def random_weights(architecture: DeepSetArchitecture, random: np.random.Generator) -> Any:
    """Return weights to begin a training with, shape (n,): normal, with the variance 1 over the number of inputs."""
    parts = []
    for name, shape in architecture.shapes().items():
        spread = 0.0 if name.endswith("bias") else shape[-1] ** -0.5
        parts.append(spread * random.standard_normal(prod(shape)))
    return np.concatenate(parts)
