"""The network of a coalition: it treats all providers alike, so that it plays with any number of
them.
"""

from collections.abc import Mapping
from math import prod
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from roletrust_env.arrays import Array, cast, namespace
from roletrust_env.game.accounts import ACCOUNT_FEATURES
from roletrust_env.game.coalition import FEATURES, IDENTITY_FEATURES

UNITS = 12
"""Number of units of each layer, unless another is given."""

_IDENTITY_UNITS, ACCOUNT_UNITS = 6, 8

GAIN = 3.0
"""Factor of the last layer: the best lies and qualities are often all or nothing."""


class DeepSetArchitecture(BaseModel):
    """Architecture of a `DeepSet`: two layers for each provider, of which the second sees the mean
    over providers.
    """

    model_config = ConfigDict(frozen=True, strict=True, extra="forbid")

    kind: Literal["deep-set"] = "deep-set"
    units: Annotated[int, Field(ge=1, le=256)] = UNITS
    """Number of units of each layer."""
    features: tuple[str, ...] = FEATURES
    """Names of the features of a provider."""
    identity_features: tuple[str, ...] = IDENTITY_FEATURES
    """Names of the features of an identity."""
    account_features: tuple[str, ...] = ()
    """Names of the features of an account of a wide network, which also decides on silence and on
    the treatment of each rater; empty for one that does not."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        of_accounts = self.account_features in ((), ACCOUNT_FEATURES)
        if not of_accounts or (self.features, self.identity_features) != (
            FEATURES,
            IDENTITY_FEATURES,
        ):
            raise ValueError("the features are not those of this version of the package")
        return self

    @classmethod
    def of(cls, units: int = UNITS, *, wide: bool) -> Self:
        """Return an architecture with all features of this version of the package."""
        return cls(units=units, account_features=ACCOUNT_FEATURES if wide else ())

    @property
    def wide(self) -> bool:
        """Whether the network also decides on silence and on the treatment of each rater."""
        return bool(self.account_features)

    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Return the shape of each weight by its name."""
        units, seen, known = self.units, len(self.features), len(self.identity_features)
        shapes: dict[str, tuple[int, ...]] = {
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
        if self.wide:
            accounts = len(self.account_features)
            shapes |= {
                "silence.weight": (1, units),
                "silence.skip": (1, seen),
                "silence.bias": (1,),
                "treatment0.weight": (ACCOUNT_UNITS, accounts),
                "treatment0.provider": (ACCOUNT_UNITS, seen),
                "treatment0.bias": (ACCOUNT_UNITS,),
                "treatment1.weight": (1, ACCOUNT_UNITS),
                "treatment1.skip": (1, accounts),
                "treatment1.bias": (1,),
            }
        return shapes

    @property
    def size(self) -> int:
        """Number of weights."""
        return sum(map(prod, self.shapes().values()))


class DeepSet:
    """Network from the features of providers to the decision of a coalition, after Zaheer et al.
    (2017).

    For each provider i with features x_i: u_i = tanh(A x_i + a), v_i = tanh(B u_i + C mean_j u_j +
    b), and (l_i, q_i, g_i) = 0.5 + 0.5 tanh(3 (D v_i + E x_i + d)). The decision is the lie 0.5 +
    g_i (l_i - 0.5), of which 0.5 is the truth, and the quality q_i if the provider is an
    accomplice. The gate g_i lets a liar tell the truth most of the time, and so keep its trust. A
    second, smaller network decides for each identity in reserve whether it shall be present.

    A wide network also decides on silence, s_i = 0.5 + 0.5 tanh(3 (S v_i + T x_i + s)), and on the
    treatment of each rater k with the account z_ki by its own provider i: 0.5 + 0.5 tanh(3 (H w_ki
    + K z_ki + h)) with w_ki = tanh(F z_ki + G x_i + f). It treats all raters by the same rule.

    K networks of one architecture play side by side in a batch of shape (K, G).

    Args:
        architecture: Architecture.
        weights: Weights by the names of `DeepSetArchitecture.shapes`, each with one further axis K
            in front, or without it for a single network.

    Raises:
        ValueError: A weight is missing, superfluous, of the wrong shape, or not finite.
    """

    def __init__(self, architecture: DeepSetArchitecture, weights: Mapping[str, Array]) -> None:
        shapes = architecture.shapes()
        if set(weights) != set(shapes):
            raise ValueError(
                f"the weights are {sorted(weights)}; the architecture has {sorted(shapes)}"
            )
        rows = weights["layer2.bias"].shape[:-1]
        for name, shape in shapes.items():
            weight_shape = tuple(weights[name].shape)
            if len(rows) > 1 or weight_shape != (*rows, *shape):
                raise ValueError(
                    f"weight {name!r} has the shape {weight_shape}; the architecture has {shape}"
                )
            if not bool(namespace(weights[name]).isfinite(weights[name]).all()):
                raise ValueError(f"weight {name!r} has entries that are not finite")
        self.architecture = architecture
        self.weights = dict(weights)

    @classmethod
    def unflatten(cls, architecture: DeepSetArchitecture, vector: Array) -> Self:
        """Return the network with its weights in a vector, shape (n,), or K networks, shape (K,
        n).
        """
        weights, at = {}, 0
        for name, shape in architecture.shapes().items():
            weights[name] = vector[..., at : at + prod(shape)].reshape(*vector.shape[:-1], *shape)
            at += prod(shape)
        return cls(architecture, weights)

    def flatten(self) -> Array:
        """Return the weights as a vector, shape (n,), or (K, n) for K networks."""
        shapes = self.architecture.shapes()
        parts = [
            self.weights[name].reshape(*self.weights[name].shape[: -len(s)], -1)
            for name, s in shapes.items()
        ]
        return namespace(parts[0]).concat(parts, axis=-1)

    def decide(self, features: Array) -> Array:
        """Return lies, qualities and of a wide network silence, shape (2 or 3, P, ...), in [0, 1].

        Args:
            features: Features of the providers, shape (F, P, ...).
        """
        seen, own = self._rows(features), self._constants(features)
        xp, (k, _, cells) = namespace(features), seen.shape
        p = features.shape[1]
        x = xp.tanh(own["layer0.weight"] @ seen + own["layer0.bias"][..., None])
        pooled = own["layer1.mean"] @ x.reshape(k, -1, p, cells // p).mean(axis=2)
        x = (own["layer1.weight"] @ x).reshape(k, -1, p, cells // p) + pooled[:, :, None, :]
        x = xp.tanh(x + own["layer1.bias"][..., None, None]).reshape(k, -1, cells)

        def outputs(name: str) -> Array:
            linear = (
                own[f"{name}.weight"] @ x
                + own[f"{name}.skip"] @ seen
                + own[f"{name}.bias"][..., None]
            )
            return self._decisions(GAIN * linear, features)

        lie, quality, gate = outputs("layer2")
        decided = xp.stack([0.5 + (lie - 0.5) * gate, quality])
        return xp.concat([decided, outputs("silence")]) if self.architecture.wide else decided

    def treatment(self, accounts: Array, features: Array) -> Array:
        """Return the treatment of each rater by each own provider, shape (S, n, ...), in [0, 1].

        Args:
            accounts: Features of the accounts, shape (A, S, n, ...).
            features: Features of the own providers, shape (F, n, ...).
        """
        a, s, n, *batch = accounts.shape
        flat, own = accounts.reshape(a, s * n, *batch), self._constants(features)
        z, of_provider = self._rows(flat), own["treatment0.provider"] @ self._rows(features)
        k, units, cells = of_provider.shape
        hidden = (own["treatment0.weight"] @ z).reshape(k, units, s, cells) + of_provider[
            :, :, None, :
        ]
        hidden = (
            namespace(z)
            .tanh(hidden + own["treatment0.bias"][..., None, None])
            .reshape(k, units, -1)
        )
        x = (
            own["treatment1.weight"] @ hidden
            + own["treatment1.skip"] @ z
            + own["treatment1.bias"][..., None]
        )
        return self._decisions(GAIN * x, flat)[0].reshape(s, n, *batch)

    def presence(self, features: Array) -> Array:
        """Return whether each identity shall be present, boolean, shape (n, ...), from features,
        shape (I, n, ...).
        """
        x, own = self._rows(features), self._constants(features)
        x = namespace(features).tanh(own["presence0.weight"] @ x + own["presence0.bias"][..., None])
        return (
            self._decisions(
                own["presence1.weight"] @ x + own["presence1.bias"][..., None], features
            )[0]
            > 0.5
        )

    def _rows(self, features: Array) -> Array:
        """Return features as K matrices, (K, F, P * G). One network sees the whole batch as one
        row.
        """
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
            same = {
                name: w if w.dtype == like.dtype else cast(w, like.dtype)
                for name, w in self.weights.items()
            }
        else:
            xp = namespace(like)
            same = {
                name: xp.asarray(w, dtype=like.dtype, device=like.device)
                for name, w in self.weights.items()
            }
        return same


def random_weights(architecture: DeepSetArchitecture, random: np.random.Generator) -> Any:
    """Return weights to begin a training with, shape (n,): normal, with the variance 1 over the
    number of inputs.
    """
    parts = []
    for name, shape in architecture.shapes().items():
        spread = 0.0 if name.endswith("bias") else shape[-1] ** -0.5
        parts.append(spread * random.standard_normal(prod(shape)))
    return np.concatenate(parts)


_TREATMENTS: tuple[dict[str, float], ...] = (
    {"bias": 5.7, "account": -10.0, "own_lead": -30.0},
    {"bias": 7.4, "account": -7.0, "known": -7.0},
)
"""Treatments from which trainings of wide networks begin, by their weights in the last layer. One
is bad where the mean rating of the rater is above 0.57 and no other own provider has a better one:
a single provider is enough to cheat. The other is bad above a threshold that falls from 0.72 after
one rating to 0.35 after five."""

ALIKE = 1.0  # bias of the treatment that serves all raters alike
TALKATIVE = -0.5  # bias of silence: every rating is sent, and a training soon meets silence
_WELL = 1.5  # bias of the quality of providers that decide by treatment alone


def widened(network: DeepSet) -> list[DeepSet]:
    """Return wide networks that lie and call identities as a network does, and differ in how they
    serve.

    The first one serves as the network does. The others serve each rater by its account, with the
    network's quality as the best one and with full quality.

    Args:
        network: Network; a wide one is returned as it is.
    """
    if network.architecture.wide:
        return [network]
    architecture = DeepSetArchitecture.of(network.architecture.units, wide=True)
    shapes = {
        name: shape for name, shape in architecture.shapes().items() if name not in network.weights
    }

    def wide(treatment: Mapping[str, float], weights: Mapping[str, Array]) -> DeepSet:
        further = {name: np.zeros(shape, np.float32) for name, shape in shapes.items()}
        further["silence.bias"] += TALKATIVE
        further["treatment1.bias"] += treatment["bias"]
        for place, name in enumerate(ACCOUNT_FEATURES):
            further["treatment1.skip"][:, place] = treatment.get(name, 0.0)
        return DeepSet(architecture, {**weights, **further})

    well = {name: np.array(weight) for name, weight in network.weights.items()}
    for name in ("layer2.weight", "layer2.skip", "layer2.bias"):
        well[name][1] = _WELL if name == "layer2.bias" else 0.0
    served = (network.weights, well)
    return [
        wide({"bias": ALIKE}, network.weights),
        *(wide(label, own) for own in served for label in _TREATMENTS),
    ]
