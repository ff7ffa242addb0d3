"""The trust models that come with the package, by name."""

from roletrust_env.trust.model import register_trust_model
from roletrust_env.trust.models.central.mean import Mean
from roletrust_env.trust.models.central.role_trust import RoleTrust
from roletrust_env.trust.models.personal.clustering import Clustering
from roletrust_env.trust.models.personal.peer_trust import PeerTrust
from roletrust_env.trust.models.personal.regression_aligned import RegressionAligned
from roletrust_env.trust.models.personal.zhang_cohen import ZhangCohen

register_trust_model("role-trust", RoleTrust)
register_trust_model("mean", Mean)
register_trust_model("clustering", Clustering)
register_trust_model("peer-trust", PeerTrust)
register_trust_model("regression-aligned", RegressionAligned)
register_trust_model("zhang-cohen", ZhangCohen)
