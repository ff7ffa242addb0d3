"""Models of neighbouring fields, for logs of real ratings, outside the registry: suites that play all models stay."""

from typing import Any

from roletrust_env.trust.models.central.all_time_mean import AllTimeMean
from roletrust_env.trust.models.central.bias_deserve import BiasDeserve
from roletrust_env.trust.models.central.centred_clipping import CentredClipping
from roletrust_env.trust.models.central.fairness_goodness import FairnessGoodness
from roletrust_env.trust.models.central.geometric_median import GeometricMedian
from roletrust_env.trust.models.central.rev2 import Rev2
from roletrust_env.trust.models.central.two_way_mean import TwoWayMean

NEIGHBOURS: dict[str, Any] = {
    "all-time-mean": AllTimeMean,
    "two-way-mean": TwoWayMean,
    "fairness-goodness": FairnessGoodness,
    "bias-deserve": BiasDeserve,
    "rev2": Rev2,
    "geometric-median": GeometricMedian,
    "centred-clipping": CentredClipping,
}
"""Classes by name. Elsewhere they are written `roletrust_env.trust.neighbours:FairnessGoodness`."""
