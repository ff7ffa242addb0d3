"""What a defence learns: the parameters of a registered trust model, or the network of
`RaterNetworkTrust`.
"""

import inspect
from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple, get_type_hints

import numpy as np

from roletrust_agents.learned.rater_network import SIZE, RaterNetworkTrust, start_weights
from roletrust_agents.training.defence import DefenceLearner, Floats
from roletrust_env.arrays import Array
from roletrust_env.errors import suggest
from roletrust_env.evaluation.specs import named_factory, parse_named
from roletrust_env.parameters import Factor, Inside, Lam, LessThanHalf, Power, Ridge, Share
from roletrust_env.trust import Ratings, TrustModel
from roletrust_env.trust.model import registry

_SCENARIO = ("initial",)  # what the scenario says about everybody is not learned
_DIGITS = 4
_ROWS = 4  # axes of ratings, (S, P, K, G)
_NETWORK = f"{RaterNetworkTrust.__module__}:{RaterNetworkTrust.__name__}"


class _Range(NamedTuple):
    """Range of a parameter in a training, with both ends."""

    low: float
    high: float
    geometric: bool = False


_RANGES: tuple[tuple[Any, _Range], ...] = (
    (Share, _Range(0.0, 1.0)),
    (Lam, _Range(0.5, 0.99)),
    (Inside, _Range(0.001, 0.999)),
    (Factor, _Range(0.01, 1.0, geometric=True)),
    (LessThanHalf, _Range(0.0, 0.49)),
    (Ridge, _Range(0.001, 10.0, geometric=True)),
    (Power, _Range(0.0, 8.0)),
)
"""Range in a training by the type of a parameter."""


@dataclass(frozen=True)
class ParameterLearner:
    """The numbers of a registered trust model, each as a place in its range: 0 at the low end and 1
    at the high one.

    Places outside [0, 1] are drawn to the nearest end. Trust before any rating is the scenario's,
    and is not learned.

    Attributes:
        name: Name of the trust model, or `package.module:Class`, whose module is imported.

    Raises:
        ValueError: The name is unknown or has parameters, or the model has no number with a range.

    Example:
        >>> learner = ParameterLearner("leave-one-out")
        >>> learner.spec(learner.start())
        'leave-one-out:keep=0.9,prior=0.2,power=6.0,doubt=0.8,own=0.0,limit=1.0,modesty=1.0'
    """

    name: str

    def __post_init__(self) -> None:
        if ":" not in self.name and self.name not in registry:
            raise ValueError(
                "unknown trust model "
                f"{self.name!r}{suggest(self.name, ['network', *registry.names()])}"
            )
        if "=" in self.name:
            raise ValueError(
                f"{self.name!r} has parameters; name the model alone, it begins at its defaults"
            )
        if not self.ranges or not self._plays_in_rows():
            raise ValueError(f"trust model {self.name!r} has no number that can be learned")

    @cached_property
    def ranges(self) -> dict[str, tuple[_Range, float]]:
        """Range and default of each number, by name."""
        factory: Any = named_factory(registry, self.name)
        hints = get_type_hints(factory, include_extras=True) if isinstance(factory, type) else {}
        ranges = {}
        for name, parameter in inspect.signature(factory).parameters.items():
            for kind, span in _RANGES:
                if (
                    name not in _SCENARIO
                    and hints.get(name) == kind
                    and parameter.default is not parameter.empty
                ):
                    ranges[name] = span, float(parameter.default)
        return ranges

    def _plays_in_rows(self) -> bool:
        """Return whether many values of each number play side by side as alone; those that a branch
        asks for do not.
        """
        vectors = np.stack([self.start(), 0.5 * self.start() + 0.2])
        ratings = np.random.default_rng(0).random((3, 2, 2, 2)).astype(np.float32)
        try:
            both = _trust_after(self.models(vectors, 0.5), ratings)
            alone = [
                _trust_after(self.models(vectors[[k]], 0.5), ratings[..., [k], :]) for k in range(2)
            ]
        except (TypeError, ValueError, IndexError):  # a formula that is for one value
            return False
        return bool(np.allclose(both, np.concatenate(alone, axis=1), atol=1e-5))

    def start(self) -> Floats:
        """Return the places of the defaults, shape (n,). See `DefenceLearner.start`."""
        return np.array([_place(*both) for both in self.ranges.values()])

    def parameters(self, vector: Floats) -> dict[str, float]:
        """Return the parameters of a vector, to four digits."""
        places = zip(self.ranges.items(), vector, strict=True)
        return {name: _value(span, float(place)) for (name, (span, _)), place in places}

    def spec(self, vector: Floats) -> str:
        """See `DefenceLearner.spec`."""
        return f"{self.name}:{','.join(f'{name}={value}' for name, value in self.parameters(vector).items())}"  # noqa: E501

    def models(self, vectors: Floats, initial: float) -> TrustModel[Any]:
        """See `DefenceLearner.models`."""
        initially = "initial" in inspect.signature(named_factory(registry, self.name)).parameters
        spec = self.spec(vectors[0]) + f",initial={initial}" * initially
        return TrustSideBySide(
            parse_named(registry, spec), _columns([self.parameters(vector) for vector in vectors])
        )


def _columns(rows: Sequence[Mapping[str, float]]) -> dict[str, Any]:
    """Return the values of each parameter in the rows, shape (K, 1)."""
    return {name: np.array([[row[name]] for row in rows], np.float32) for name in rows[0]}


class TrustSideBySide:
    """K models of one formula as one, for a batch of games of shape (K, G): the k-th plays in the
    k-th row.

    A single game, in which a new task tries its model, is played by the model that the others are
    made of.

    Args:
        model: Model with all other parameters. Its formula must be one for arrays in the place of
            these numbers.
        rows: Values of the numbers that differ, by name, each in a shape that broadcasts with (K,
            G).
    """

    def __init__(self, model: TrustModel[Any], rows: Mapping[str, np.ndarray[Any, Any]]) -> None:
        self.rates_raters = model.rates_raters
        self._alone, self._together = model, copy(model)
        for name, values in rows.items():
            object.__setattr__(
                self._together, name, values
            )  # the class is frozen, and checks single numbers
        if hasattr(model, "judge_trust"):  # consumers then go by the trust of their own
            self.judge_trust = model.judge_trust

    def start(self, like: Array) -> Any:
        """Return the state before any rating. See `TrustModel.start`."""
        return self._players(like).start(like)

    def update(self, state: Any, ratings: Ratings) -> Any:
        """Return the state after one more round. See `TrustModel.update`."""
        return self._players(ratings.values).update(state, ratings)

    def rater_trust(self, state: Any) -> Array:
        """Return the trust of each rater. See `TrustModel.rater_trust`."""
        return self._alone.rater_trust(state)

    def provider_trust(self, state: Any) -> Array:
        """Return the trust of each provider. See `TrustModel.provider_trust`."""
        return self._alone.provider_trust(state)

    def _players(self, ratings: Array) -> TrustModel[Any]:
        return self._together if ratings.ndim == _ROWS else self._alone


def _trust_after(model: TrustModel[Any], ratings: Array) -> Array:
    """Return both trusts after two rounds, (S + P, K, G)."""
    state = model.start(ratings)
    for now in (ratings, 1 - ratings):
        state = model.update(state, Ratings(now, now > 0.1))
    return np.concatenate([model.rater_trust(state), model.provider_trust(state)])


def _place(span: _Range, value: float) -> float:
    if span.geometric:
        return float(np.log(value / span.low) / np.log(span.high / span.low))
    return (value - span.low) / (span.high - span.low)


def _value(span: _Range, place: float) -> float:
    place = min(max(place, 0.0), 1.0)
    width = span.high - span.low
    value = (
        span.low * (span.high / span.low) ** place if span.geometric else span.low + width * place
    )
    return float(f"{min(max(value, span.low), span.high):.{_DIGITS}g}")


@dataclass(frozen=True)
class NetworkLearner:
    """The weights of `RaterNetworkTrust`, to five digits, behind the numbers of leave-one-out trust
    in it.
    """

    name: str = "network"

    @property
    def _numbers(self) -> ParameterLearner:
        return ParameterLearner("leave-one-out")

    def start(self) -> Floats:
        """Return the numbers and weights that leave leave-one-out trust as it is. See
        `DefenceLearner.start`.
        """
        return np.concatenate([self._numbers.start(), start_weights()])

    def parameters(self, vector: Floats) -> dict[str, float]:
        """Return the numbers of leave-one-out trust in a vector."""
        return self._numbers.parameters(vector[:-SIZE])

    def weights(self, vector: Floats) -> tuple[float, ...]:
        """Return the weights of a vector as they are in the model."""
        return tuple(float(f"{weight:.5g}") for weight in vector[-SIZE:])

    def spec(self, vector: Floats) -> str:
        """See `DefenceLearner.spec`."""
        numbers = ",".join(f"{name}={value}" for name, value in self.parameters(vector).items())
        return f"{_NETWORK}:{numbers},weights=[{','.join(map(str, self.weights(vector)))}]"

    def models(self, vectors: Floats, initial: float) -> TrustModel[Any]:
        """See `DefenceLearner.models`."""
        rows, weights = (
            [self.parameters(vector) for vector in vectors],
            [self.weights(vector) for vector in vectors],
        )
        model = RaterNetworkTrust(initial=initial, weights=weights[0], **rows[0])
        return TrustSideBySide(model, {**_columns(rows), "weights": np.array(weights, np.float32)})


def learner_of(name: str) -> DefenceLearner:
    """Return what a defence learns, by its name: a trust model, see `ParameterLearner`, or
    `network`.

    Raises:
        ValueError: The name is unknown, or the model has no number that can be learned.
    """
    return NetworkLearner() if name == NetworkLearner.name else ParameterLearner(name)
