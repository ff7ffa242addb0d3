"""The public names, each imported from its module when it is first used."""

from roletrust_env import metrics as metrics
from roletrust_env.benchmarking import benchmark as benchmark
from roletrust_env.envs.aec import env as env
from roletrust_env.envs.jax_env import AttackJaxEnv as AttackJaxEnv
from roletrust_env.envs.jax_env import RoleTrustJaxEnv as RoleTrustJaxEnv
from roletrust_env.envs.parallel import RoleTrustParallelEnv as RoleTrustParallelEnv
from roletrust_env.envs.parallel import parallel_env as parallel_env
from roletrust_env.envs.sb3 import AttackVecEnv as AttackVecEnv
from roletrust_env.envs.sb3 import RoleVecEnv as RoleVecEnv
from roletrust_env.envs.wrappers import DiscretizeLevels as DiscretizeLevels
from roletrust_env.envs.wrappers import FixedAgents as FixedAgents
from roletrust_env.envs.wrappers import ParallelTransformAction as ParallelTransformAction
from roletrust_env.envs.wrappers import RescaleClipAction as RescaleClipAction
from roletrust_env.evaluation.evaluate import evaluate as evaluate
from roletrust_env.evaluation.games import play as play
from roletrust_env.game.attack_task import AttackTask as AttackTask
from roletrust_env.game.game import Game as Game
from roletrust_env.game.joint_policy import JointPolicy as JointPolicy
from roletrust_env.game.joint_policy import Player as Player
from roletrust_env.game.make_task import make_task as make_task
from roletrust_env.game.policy import Policy as Policy
from roletrust_env.game.policy import WindowedAttack as WindowedAttack
from roletrust_env.game.policy import attackers as attackers
from roletrust_env.game.policy import make_attacker as make_attacker
from roletrust_env.game.policy import register_attacker as register_attacker
from roletrust_env.game.rollout import History as History
from roletrust_env.game.rollout import record as record
from roletrust_env.game.sparse import SparseGame as SparseGame
from roletrust_env.game.state import Actions as Actions
from roletrust_env.game.state import Noise as Noise
from roletrust_env.game.state import State as State
from roletrust_env.logs import TrustStream as TrustStream
from roletrust_env.logs import rate as rate
from roletrust_env.randomness import Random as Random
from roletrust_env.trust import TrustModel as TrustModel
from roletrust_env.trust import make_trust_model as make_trust_model
from roletrust_env.trust import register_trust_model as register_trust_model
from roletrust_env.trust import trust_models as trust_models
from roletrust_env.world import Scenario as Scenario
from roletrust_env.world import load_scenario as load_scenario
from roletrust_env.world import make_scenario as make_scenario
from roletrust_env.world import register_scenario as register_scenario
from roletrust_env.world import scenarios as scenarios

__version__: str
