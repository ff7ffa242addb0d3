"""The trust models that come with the package, by name."""

from roletrust_env.trust.model import register_trust_model
from roletrust_env.trust.models.central.constant import Constant
from roletrust_env.trust.models.central.mean import Mean
from roletrust_env.trust.models.central.role_trust import RoleTrust

register_trust_model("role-trust", RoleTrust)
register_trust_model("constant", Constant)
register_trust_model("mean", Mean)
