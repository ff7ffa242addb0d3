"""The trust models that come with the package, by name."""

from roletrust_env.trust.model import register_trust_model
from roletrust_env.trust.models.central.mean import Mean
from roletrust_env.trust.models.central.role_trust import RoleTrust
from roletrust_env.trust.models.personal.clustering import Clustering
from roletrust_env.trust.models.personal.fire import Fire
from roletrust_env.trust.models.personal.peer_trust import PeerTrust
from roletrust_env.trust.models.personal.qor import QualityOfRecommendation
from roletrust_env.trust.models.personal.regression_aligned import RegressionAligned
from roletrust_env.trust.models.personal.subjective_logic import SubjectiveLogic
from roletrust_env.trust.models.personal.yu_singh import YuSingh
from roletrust_env.trust.models.personal.zhang_cohen import ZhangCohen

register_trust_model("role-trust", RoleTrust)
register_trust_model("mean", Mean)

register_trust_model("clustering", Clustering)
register_trust_model("fire", Fire)
register_trust_model("peer-trust", PeerTrust)
register_trust_model("qor", QualityOfRecommendation)
register_trust_model("regression-aligned", RegressionAligned)
register_trust_model("subjective-logic", SubjectiveLogic)
register_trust_model("yu-singh", YuSingh)
register_trust_model("zhang-cohen", ZhangCohen)
