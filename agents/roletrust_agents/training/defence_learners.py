"""What a defence learns: the parameters of a registered trust model, or the network of `RaterNetworkTrust`."""

import inspect
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple, get_type_hints

import numpy as np

from roletrust_agents.learned.rater_network import RaterNetworkTrust, start_weights
from roletrust_agents.training.defence import Floats, Learner
from roletrust_env.errors import suggest
from roletrust_env.ranges import Factor, Inside, Lam, LessThanHalf, Power, Ridge, Share
from roletrust_env.trust import TrustModel, make_trust_model
from roletrust_env.trust.model import registry

_SCENARIO = ("initial",)  # what the scenario says about everybody is not learned
_DIGITS = 4
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
    """The numbers of a registered trust model, each as a place in its range: 0 at the low end and 1 at the high one.

    Places outside [0, 1] are drawn to the nearest end. Trust before any rating is the scenario's, and is not learned.

    Attributes:
        name: Name of the trust model.

    Raises:
        ValueError: The name is unknown, or the model has no number with a range.

    Example:
        >>> learner = ParameterLearner("leave-one-out")
        >>> learner.spec(learner.start())
        'leave-one-out:keep=0.9,prior=0.2,power=6.0,doubt=0.8,own=0.0,limit=1.0,modesty=1.0'
    """

    name: str

    def __post_init__(self) -> None:
        if self.name not in registry:
            raise ValueError(f"unknown trust model {self.name!r}{suggest(self.name, ['network', *registry.names()])}")
        if not self.ranges:
            raise ValueError(f"trust model {self.name!r} has no number that can be learned")

    @cached_property
    def ranges(self) -> dict[str, tuple[_Range, float]]:
        """Range and default of each number, by name."""
        factory: Any = registry.factory(self.name)
        hints = get_type_hints(factory, include_extras=True) if isinstance(factory, type) else {}
        found = {}
        for name, parameter in inspect.signature(factory).parameters.items():
            for kind, span in _RANGES:
                if name not in _SCENARIO and hints.get(name) == kind and parameter.default is not parameter.empty:
                    found[name] = span, float(parameter.default)
        return found

    def start(self) -> Floats:
        """Return the places of the defaults, shape (n,). See `Learner.start`."""
        return np.array([_place(*both) for both in self.ranges.values()])

    def parameters(self, vector: Floats) -> dict[str, float]:
        """Return the parameters of a vector, to four digits."""
        places = zip(self.ranges.items(), vector, strict=True)
        return {name: _value(span, float(place)) for (name, (span, _)), place in places}

    def spec(self, vector: Floats) -> str:
        """See `Learner.spec`."""
        return f"{self.name}:{','.join(f'{name}={value}' for name, value in self.parameters(vector).items())}"

    def model(self, vector: Floats, initial: float) -> TrustModel[Any]:
        """See `Learner.model`."""
        given = registry.accepted_parameters(self.name, {"initial": initial})
        return make_trust_model(self.name, **given, **self.parameters(vector))


def _place(span: _Range, value: float) -> float:
    if span.geometric:
        return float(np.log(value / span.low) / np.log(span.high / span.low))
    return (value - span.low) / (span.high - span.low)


def _value(span: _Range, place: float) -> float:
    place = min(max(place, 0.0), 1.0)
    width = span.high - span.low
    value = span.low * (span.high / span.low) ** place if span.geometric else span.low + width * place
    return float(f"{min(max(value, span.low), span.high):.{_DIGITS}g}")


@dataclass(frozen=True)
class NetworkLearner:
    """The weights of `RaterNetworkTrust`, to five digits. Its other parameters stay at their defaults."""

    name: str = "network"

    def start(self) -> Floats:
        """Return the weights with which leave-one-out trust is left as it is. See `Learner.start`."""
        return start_weights()

    def weights(self, vector: Floats) -> tuple[float, ...]:
        """Return the weights of a vector as they are in the model."""
        return tuple(float(f"{weight:.5g}") for weight in vector)

    def spec(self, vector: Floats) -> str:
        """See `Learner.spec`."""
        return f"{_NETWORK}:weights=[{','.join(map(str, self.weights(vector)))}]"

    def model(self, vector: Floats, initial: float) -> TrustModel[Any]:
        """See `Learner.model`."""
        return RaterNetworkTrust(initial=initial, weights=self.weights(vector))


def learner_of(name: str) -> Learner:
    """Return what a defence learns, by its name: a registered trust model, or `network`.

    Raises:
        ValueError: The name is unknown, or the model has no number that can be learned.
    """
    return NetworkLearner() if name == NetworkLearner.name else ParameterLearner(name)
