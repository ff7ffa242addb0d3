"""The trust models that come with the package, by name."""

from roletrust_env.trust.model import register_trust_model
from roletrust_env.trust.models.central.beta_reputation import Beta, BetaFiltered
from roletrust_env.trust.models.central.iterative_filtering import IterativeFiltering
from roletrust_env.trust.models.central.leave_one_out import LeaveOneOut
from roletrust_env.trust.models.central.means import (
    Constant,
    DeviationWeighted,
    HuberMean,
    Mean,
    Median,
    TrimmedMean,
)
from roletrust_env.trust.models.central.random_walks import EigenTrust, PowerTrust
from roletrust_env.trust.models.central.role_trust import RoleTrust
from roletrust_env.trust.models.central.seeded_walks import (
    MeritRank,
    PersonalizedPageRank,
    SybilRank,
)
from roletrust_env.trust.models.central.wary_role_trust import WaryRoleTrust
from roletrust_env.trust.models.personal.blade import Blade
from roletrust_env.trust.models.personal.blended import Blended
from roletrust_env.trust.models.personal.block import AgreedOnce, Block, BlockForgiving
from roletrust_env.trust.models.personal.fire import Fire
from roletrust_env.trust.models.personal.first_hand import FirstHand
from roletrust_env.trust.models.personal.habit import Habit
from roletrust_env.trust.models.personal.opinions import SubjectiveLogic
from roletrust_env.trust.models.personal.qor import QualityOfRecommendation
from roletrust_env.trust.models.personal.regression_aligned import RegressionAligned
from roletrust_env.trust.models.personal.similarity import Clustering, OwnExperience, PeerTrust
from roletrust_env.trust.models.personal.solo import (
    Subsampled,
    Thompson,
    Threshold,
    UpperConfidence,
)
from roletrust_env.trust.models.personal.travos import Travos
from roletrust_env.trust.models.personal.vial import Vial
from roletrust_env.trust.models.personal.yu_singh import YuSingh
from roletrust_env.trust.models.personal.zhang_cohen import ZhangCohen

OWN = {
    "role-trust": RoleTrust,
    "beta": Beta,
    "beta-filtered": BetaFiltered,
    "constant": Constant,
    "deviation-weighted": DeviationWeighted,
    "eigentrust": EigenTrust,
    "huber-mean": HuberMean,
    "iterative-filtering": IterativeFiltering,
    "leave-one-out": LeaveOneOut,
    "mean": Mean,
    "median": Median,
    "merit-rank": MeritRank,
    "personalized-pagerank": PersonalizedPageRank,
    "power-trust": PowerTrust,
    "sybil-rank": SybilRank,
    "trimmed-mean": TrimmedMean,
    "wary-role-trust": WaryRoleTrust,
    "agreed-once": AgreedOnce,
    "blade": Blade,
    "blended": Blended,
    "block": Block,
    "block-forgiving": BlockForgiving,
    "clustering": Clustering,
    "fire": Fire,
    "first-hand": FirstHand,
    "habit": Habit,
    "own-experience": OwnExperience,
    "peer-trust": PeerTrust,
    "qor": QualityOfRecommendation,
    "regression-aligned": RegressionAligned,
    "solo-subsampled": Subsampled,
    "solo-thompson": Thompson,
    "solo-threshold": Threshold,
    "solo-ucb": UpperConfidence,
    "subjective-logic": SubjectiveLogic,
    "travos": Travos,
    "vial": Vial,
    "yu-singh": YuSingh,
    "zhang-cohen": ZhangCohen,
}
"""Classes of the models of this package, by name. No other class is one of them, whatever it says
of itself."""

for _name, _model in OWN.items():
    register_trust_model(_name, _model)
