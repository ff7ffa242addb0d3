"""Trust models: pure functions over arrays, from ratings to the trust of raters and providers."""

from roletrust_env.trust.algorithms import agent_trust, masked_mean, provider_trust, rater_trust, smooth
from roletrust_env.trust.model import (
    TrustModel,
    check_trust_model,
    make_trust_model,
    register_trust_model,
    takes_full_rounds,
    trust_models,
)
from roletrust_env.trust.models.mean import Mean
from roletrust_env.trust.models.role_trust import RoleTrust

register_trust_model("role-trust", RoleTrust)
register_trust_model("mean", Mean)

__all__ = [
    "Mean",
    "RoleTrust",
    "TrustModel",
    "agent_trust",
    "check_trust_model",
    "make_trust_model",
    "masked_mean",
    "provider_trust",
    "rater_trust",
    "register_trust_model",
    "smooth",
    "takes_full_rounds",
    "trust_models",
]
