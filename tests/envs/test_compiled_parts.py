"""Parts of other packages, and of this one that were once played wrongly, in compiled rounds."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import gymnasium
import numpy as np
import pytest
from refusals import refuses

import roletrust_env as rt
from roletrust_baselines import RandomRating

TASK = "RoleTrust/RaterAttack-v0"
ENGINES = "rules", "compiled"


class Trusts(NamedTuple):
    tor: Any
    top: Any


@dataclass(frozen=True)
class Foreign(rt.TrustModel[Trusts]):
    """A trust model that this package does not know."""

    lam: float = 0.3

    def start(self, like):
        return Trusts(0 * like[:, 0, ...] + 0.5, 0 * like[0, ...] + 0.5)

    def update(self, state, ratings):
        top = self.lam * ratings.values.mean(axis=0) + (1 - self.lam) * state.top
        return Trusts(state.tor, top)

    def rater_trust(self, state):
        return state.tor

    def provider_trust(self, state):
        return state.top


@dataclass(frozen=True)
class Serving(rt.Policy):
    """A provider whose quality is a function of its view."""

    rule: Any

    def quality(self, view, memory, random):
        return self.rule(view), memory


def rewards(engine, games=None, **arguments):
    """Return the rewards of twelve rounds of a task."""
    if games is None:
        env = gymnasium.make(TASK, engine=engine, **arguments)
    else:
        env = gymnasium.make_vec(TASK, games, engine=engine, **arguments)
    env.reset(seed=0)
    random = np.random.default_rng(0)
    return np.array(
        [env.step(random.random(env.action_space.shape, np.float32))[1] for _ in range(12)]
    )


def assert_engines_agree(games=None, **arguments):
    one, other = (rewards(engine, games, **arguments) for engine in ENGINES)
    np.testing.assert_allclose(one, other, rtol=0, atol=1e-12)


@pytest.mark.parametrize("games", [None, 5])
def test_trust_model_of_another_package(games):
    assert_engines_agree(games, trust_model=Foreign())


def test_model_that_branches_is_refused_by_its_branch():
    class Branching(Foreign):
        def update(self, state, ratings):
            return state if ratings.values.sum() > 0 else super().update(state, ratings)

    with refuses(ValueError, "branch"):
        rt.parallel_env("paper-3x3", Branching(), engine="compiled")


@pytest.mark.parametrize("games", [None, 5, 20])
def test_agents_that_share_a_policy_draw_numbers_of_their_own(games):
    assert_engines_agree(games, others={"sr_0": RandomRating(), "sr_1": RandomRating()})


@pytest.mark.parametrize("games", [None, 5])
def test_memory_that_begins_with_one_row_for_all_agents(games):
    assert_engines_agree(games, others={"sp_0": rt.make_attacker("personal-milking")})


def _sorted(view):
    rated = np.sort(np.where(view.rated > 0, view.ratings, np.nan), axis=0)[0]
    return np.where(np.isnan(rated), 1.0, rated * 0.5)


def _long(view):
    quality = view.quality
    for k in range(2000):
        quality = quality * 0.99 + 0.001 * (k % 3) * view.quality
    return quality


@pytest.mark.parametrize(
    "rule",
    [
        _sorted,
        _long,
        lambda view: 0.5 + 0.5 * (-0.5) ** np.floor(view.round % 4),
        lambda view: 0.5 - 0.1 * (view.trust - 2.0) ** -1.0,
    ],
    ids=["sort of NaN", "long", "power of a constant", "power of a trust"],
)
def test_rule_of_a_policy(rule):
    assert_engines_agree(others={"sp_0": Serving(rule)}, ratings={"lost": 0.4})


@pytest.mark.parametrize("value", [2.0, -1.0, np.nan])
@pytest.mark.parametrize("games", [None, 5])
def test_action_of_a_policy_outside_its_range_is_refused(value, games):
    others = {"sp_0": Serving(lambda view: 0 * view.trust + value)}
    for engine in ENGINES:
        with refuses(ValueError):
            rewards(engine, games, others=others)


def test_changeable_part_inside_a_frozen_one_is_refused():
    class Changeable(rt.Policy):
        def __init__(self):
            self.level = 0.5

    with refuses(ValueError, "Changeable"):
        gymnasium.make(TASK, engine="compiled", others={"sp_0": Serving(Changeable())})


def test_memory_may_be_a_number():
    class Counting(rt.Policy):
        def begin(self, random, shape):
            return 0.0

        def quality(self, view, memory, random):
            return 0 * view.trust + 1 / (1 + memory), memory + 1

    assert rewards("rules", 4, others={"sp_0": Counting()}).shape == (12, 4)


def test_actions_of_a_coalition_are_decoded_in_the_precision_of_the_game():
    played = []
    for engine in ENGINES:
        env = gymnasium.make("RoleTrust/CollusionAttack-v0", engine=engine, observation="coalition")
        env.reset(seed=0)
        random = np.random.default_rng(0)
        shape = env.action_space.shape
        played.append([env.step(random.random(shape, np.float32))[1] for _ in range(30)])
    np.testing.assert_allclose(*played, rtol=0, atol=1e-12)
