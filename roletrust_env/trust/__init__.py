"""Trust models: pure functions over arrays, from ratings to the trust of raters and providers."""

from roletrust_env.shapes import PairAge, PerPair, PerProvider, PerRater
from roletrust_env.trust.algorithms import agent_trust, provider_trust, rater_trust
from roletrust_env.trust.model import (
    Traits,
    TrustModel,
    make_trust_model,
    register_trust_model,
    trust_models,
)
from roletrust_env.trust.models.central.means import Mean
from roletrust_env.trust.models.central.role_trust import RoleTrust
from roletrust_env.trust.ratings import (
    PROVIDER,
    RATER,
    Ratings,
    mean,
    smooth,
    weighted_mean,
)

__all__ = [
    "PROVIDER",
    "RATER",
    "Mean",
    "PairAge",
    "PerPair",
    "PerProvider",
    "PerRater",
    "Ratings",
    "RoleTrust",
    "Traits",
    "TrustModel",
    "agent_trust",
    "make_trust_model",
    "mean",
    "provider_trust",
    "rater_trust",
    "register_trust_model",
    "smooth",
    "trust_models",
    "weighted_mean",
]
