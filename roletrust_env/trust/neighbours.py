"""Models of neighbouring fields, for logs of real ratings, outside the registry: suites that play all models stay."""

from typing import Any

from roletrust_env.trust.models.central.all_time_mean import AllTimeMean
from roletrust_env.trust.models.central.bias_deserve import BiasDeserve
from roletrust_env.trust.models.central.fairness_goodness import FairnessGoodness
from roletrust_env.trust.models.central.two_way_mean import TwoWayMean

NEIGHBOURS: dict[str, Any] = {
    "all-time-mean": AllTimeMean,
    "two-way-mean": TwoWayMean,
    "fairness-goodness": FairnessGoodness,
    "bias-deserve": BiasDeserve,
}
"""Classes by name. Elsewhere they are written `roletrust_env.trust.neighbours:FairnessGoodness`."""
