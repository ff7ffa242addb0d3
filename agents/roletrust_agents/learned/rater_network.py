"""A trust model with a small network: from how a rater's ratings compare with those of others to
the trust in it.
"""

from collections.abc import Mapping
from math import prod
from typing import Annotated

import numpy as np
import numpy.typing as npt
from pydantic import Field

from roletrust_env.arrays import Array, namespace
from roletrust_env.parameters import checked_dataclass
from roletrust_env.randomness import generator
from roletrust_env.trust.models.central.leave_one_out import Compared, LeaveOneOut
from roletrust_env.trust.ratings import PROVIDER, RATER, TINY, Ratings, weighted_mean

Floats = npt.NDArray[np.float64]

FEATURES = ("deviation", "distance", "level", "voice", "dispute")
"""Names of the features of a pair of rater and provider, see `RaterNetworkTrust`."""

UNITS = 8
"""Number of units of each layer."""

_SCALE = 4.0  # of deviations, which are small
_GAIN = 4.0  # of what the network says, so that small weights matter
_OPEN = 3.0  # logit of the share of a rater's trust that a network without weights leaves


SHAPES: Mapping[str, tuple[int, ...]] = {
    "pair.weight": (UNITS, len(FEATURES)),
    "pair.bias": (UNITS,),
    "rater.weight": (UNITS, UNITS),
    "rater.mean": (UNITS, UNITS),
    "rater.bias": (UNITS,),
    "trust.weight": (UNITS,),
    "trust.agreement": (1,),
    "trust.bias": (1,),
}
"""Shape of each weight by its name, in their order in a vector."""

SIZE = sum(map(prod, SHAPES.values()))
"""Number of weights."""

MAX_WEIGHT = 1e6
"""Largest absolute value of a weight: with it, sums stay finite in single precision."""


def start_weights(seed: int = 0) -> Floats:
    """Return weights to begin a training with, shape (n,): random layers, and a last one that says
    nothing.

    The model is then leave-one-out, with the trust of every rater times the same sigmoid(3).
    """
    rng, parts = generator(seed), []
    for name, shape in SHAPES.items():
        silent = name.startswith("trust.") or name.endswith("bias")
        parts.append((0.0 if silent else shape[-1] ** -0.5) * rng.standard_normal(prod(shape)))
    return np.concatenate(parts)


@checked_dataclass
class RaterNetworkTrust(LeaveOneOut):
    """Leave-one-out trust whose trust in raters a network decides, after Zaheer et al. (2017).

    The network sees what leave-one-out trust computes of each pair, see `LeaveOneOut`: the features
    y[i, j] are

    - `deviation` and `distance`: 4 (x[i, j] - c[i, j]), and its absolute value;
    - `level`: x[i, j] - initial;
    - `voice`: v[i, j];
    - `dispute`: the mean of the distances of the raters of j, weighted by their voices.

    With the evidence e[i, j], the agreement a[i], and weights A to E and g:

        u[i]   = mean over j of tanh(A y[i, j] + b1), weighted by e[i, j]
        m      = mean over i of u[i], weighted by the sum over j of e[i, j]
        ToR[i] = a[i]^power sigmoid(3 + 4 (D tanh(B u[i] + C m + b2) + g (a[i] - 1) + b3))

    All raters and all providers are treated alike, so it plays with any number of them, on grids
    and on lists of ratings. Everything else is as in `LeaveOneOut`, with its parameters.

    Attributes:
        weights: Weights of the network in one row, in the order of `SHAPES`.

    Raises:
        ValueError: The number of weights is wrong, or one lies outside [-1e6, 1e6].

    Example:
        >>> model = RaterNetworkTrust(weights=tuple(start_weights()))
        >>> ratings = np.array([[0.9, 0.4], [0.9, 0.5], [0.1, 1.0]])
        >>> state = model.update(model.start(ratings), Ratings(ratings))
        >>> model.rater_trust(state).round(3)
        array([0.178, 0.214, 0.081])
    """

    weights: Annotated[
        tuple[Annotated[float, Field(ge=-MAX_WEIGHT, le=MAX_WEIGHT)], ...],
        Field(min_length=SIZE, max_length=SIZE),
    ] = Field(kw_only=True)

    nearby = False  # a rater's trust depends on the mean of all raters

    def believed(self, pairs: Ratings, compared: Compared) -> Array:
        """See `LeaveOneOut.believed`."""
        xp, evidence, like = namespace(compared.evidence), compared.evidence, compared.agreement
        own = {
            name: xp.asarray(part, dtype=like.dtype, device=like.device)
            for name, part in split(np.asarray(self.weights)).items()
        }
        deviation = _SCALE * (compared.apart - compared.view)
        distance = abs(deviation)
        dispute = pairs.gather(weighted_mean(pairs, distance, compared.voice, PROVIDER), PROVIDER)
        seen = xp.stack(
            [deviation, distance, compared.above, compared.voice, dispute + 0 * deviation]
        )
        pair = xp.tanh(_layer(own["pair.weight"], seen) + _column(own["pair.bias"], seen))
        pooled = xp.stack(
            [weighted_mean(pairs, pair[k, ...], evidence, RATER) for k in range(UNITS)]
        )
        mass = pairs.reduce(evidence, RATER)
        mean = (pooled * mass).sum(axis=1) / (mass.sum(axis=0) + TINY)
        rater = _layer(own["rater.weight"], pooled) + _layer(own["rater.mean"], mean)[:, None, ...]
        rater = xp.tanh(rater + _column(own["rater.bias"], pooled))
        said = _layer(own["trust.weight"][..., None, :], rater)[0, ...] + own["trust.bias"]
        said = said + own["trust.agreement"] * (compared.agreement - 1)
        share = 0.5 + 0.5 * xp.tanh(0.5 * (_OPEN + _GAIN * said))
        return super().believed(pairs, compared) * share


def split(vector: Floats) -> dict[str, Floats]:
    """Return the weights of a vector, shape (n,), by name, or of K vectors, shape (K, n)."""
    parts, at = {}, 0
    for name, shape in SHAPES.items():
        parts[name] = vector[..., at : at + prod(shape)].reshape(*vector.shape[:-1], *shape)
        at += prod(shape)
    return parts


def _layer(weights: Array, inputs: Array) -> Array:
    """Return the weights, (H, F), times the inputs, (F, ...); or K weights, (K, H, F), times inputs
    (F, ..., K, G).
    """
    xp = namespace(inputs)
    if weights.ndim == 2:
        return xp.tensordot(weights, inputs, axes=1)
    rows = xp.moveaxis(inputs, -2, 0)
    outputs = weights @ rows.reshape(*rows.shape[:2], -1)
    return xp.moveaxis(outputs.reshape(*outputs.shape[:2], *rows.shape[2:]), 0, -2)


def _column(bias: Array, like: Array) -> Array:
    """Return a bias, (H,) or (K, H), in a shape that broadcasts with an array of as many axes as
    another.
    """
    if bias.ndim == 1:
        return bias.reshape(-1, *[1] * (like.ndim - 1))
    return bias.T.reshape(bias.shape[1], *[1] * (like.ndim - 3), bias.shape[0], 1)
