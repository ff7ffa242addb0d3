"""The trust models that come with the package, by name."""

from roletrust_env.trust.model import register_trust_model
from roletrust_env.trust.models.central.beta_reputation import Beta, BetaFiltered
from roletrust_env.trust.models.central.iterative_filtering import IterativeFiltering
from roletrust_env.trust.models.central.leave_one_out import LeaveOneOut
from roletrust_env.trust.models.central.means import Constant, DeviationWeighted, HuberMean, Mean, Median, TrimmedMean
from roletrust_env.trust.models.central.random_walks import EigenTrust, PowerTrust
from roletrust_env.trust.models.central.role_trust import RoleTrust
from roletrust_env.trust.models.central.wary_role_trust import WaryRoleTrust
from roletrust_env.trust.models.personal.fire import Fire
from roletrust_env.trust.models.personal.first_hand import FirstHand
from roletrust_env.trust.models.personal.opinions import SubjectiveLogic
from roletrust_env.trust.models.personal.qor import QualityOfRecommendation
from roletrust_env.trust.models.personal.regression_aligned import RegressionAligned
from roletrust_env.trust.models.personal.similarity import Clustering, OwnExperience, PeerTrust
from roletrust_env.trust.models.personal.travos import Travos
from roletrust_env.trust.models.personal.yu_singh import YuSingh
from roletrust_env.trust.models.personal.zhang_cohen import ZhangCohen

register_trust_model("role-trust", RoleTrust)
register_trust_model("beta", Beta)
register_trust_model("beta-filtered", BetaFiltered)
register_trust_model("constant", Constant)
register_trust_model("deviation-weighted", DeviationWeighted)
register_trust_model("eigentrust", EigenTrust)
register_trust_model("huber-mean", HuberMean)
register_trust_model("iterative-filtering", IterativeFiltering)
register_trust_model("leave-one-out", LeaveOneOut)
register_trust_model("mean", Mean)
register_trust_model("median", Median)
register_trust_model("power-trust", PowerTrust)
register_trust_model("trimmed-mean", TrimmedMean)
register_trust_model("wary-role-trust", WaryRoleTrust)

register_trust_model("clustering", Clustering)
register_trust_model("fire", Fire)
register_trust_model("first-hand", FirstHand)
register_trust_model("own-experience", OwnExperience)
register_trust_model("peer-trust", PeerTrust)
register_trust_model("qor", QualityOfRecommendation)
register_trust_model("regression-aligned", RegressionAligned)
register_trust_model("subjective-logic", SubjectiveLogic)
register_trust_model("travos", Travos)
register_trust_model("yu-singh", YuSingh)
register_trust_model("zhang-cohen", ZhangCohen)
