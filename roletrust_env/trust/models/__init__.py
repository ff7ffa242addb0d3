"""The trust models that come with the package, by name."""

from roletrust_env.trust.model import register_trust_model
from roletrust_env.trust.models.central.beta import Beta
from roletrust_env.trust.models.central.beta_filtered import BetaFiltered
from roletrust_env.trust.models.central.mean import Mean
from roletrust_env.trust.models.central.role_trust import RoleTrust
from roletrust_env.trust.models.personal.travos import Travos

register_trust_model("beta", Beta)
register_trust_model("beta-filtered", BetaFiltered)
register_trust_model("role-trust", RoleTrust)
register_trust_model("mean", Mean)
register_trust_model("travos", Travos)
