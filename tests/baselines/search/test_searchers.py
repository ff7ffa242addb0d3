"""Scripted attackers as points to search through, and the searchers."""

from dataclasses import dataclass
from functools import partial
from typing import Annotated, ClassVar

import numpy as np
import pytest
from refusals import refuses

from roletrust_baselines import BadMouthing, OnOff, Whitewashing
from roletrust_baselines.search import (
    CmaEs,
    PaperAttacks,
    RandomSearch,
    ScriptTrial,
)
from roletrust_env import Policy
from roletrust_env.evaluation.attackers import (
    HONEST_POLICY,
    Both,
    Scripted,
    SideBySide,
    side_by_side,
)
from roletrust_env.evaluation.measurement import SEARCHED, exact_task, mean_rewards
from roletrust_env.evaluation.scripts import Scripts, describe_attack
from roletrust_env.evaluation.search import Budget, UnsuitableError, find
from roletrust_env.game.make_task import make_task
from roletrust_env.parameters import SearchRange

PROVIDER = {
    "scenario": "paper-3x3",
    "noise": 0.0,
    "perturbations": (),
    "max_cycles": 20,
    "compromised": ("sp_2",),
    "objective": "exploit",
}
CROWD = {
    "scenario": "crowd-10x10",
    "max_cycles": 10,
    "compromised": ("sr_8", "sr_9", "sp_9"),
    "objective": "damage",
}
DUAL = {"scenario": "peers", "max_cycles": 10, "compromised": ("srsp_5",), "objective": "exploit"}
SEARCHERS = [RandomSearch(), CmaEs()]


@dataclass(frozen=True)
class Stingy(Policy):
    """A user's own attack, always the same service, not much below what would be honest."""

    service: Annotated[float, SearchRange(0.9, 1.0)] = 1.0
    attacks: ClassVar = frozenset({"quality"})

    def quality(self, view, memory, random):
        return 0 * view.trust + self.service, memory


def nobody(rounds):
    """Tells nobody."""


def found(method, arguments, budget, seed=0):
    return find(method, arguments, budget=budget, seed=seed, games=4)


def scripts(arguments):
    return Scripts.of(make_task(**arguments))


def test_the_cube_has_the_parameters_of_every_compromised_agent():
    assert [scripts(arguments).size for arguments in (PROVIDER, CROWD, DUAL)] == [4, 10, 7]


def test_corners_of_the_cube_are_attacks_on_the_honest_only():
    space = scripts(CROWD)
    low, high = space.decode(np.zeros(10)), space.decode(np.ones(10))
    assert low["sp_9"] == OnOff(period=1, duty=0, bad=0, good=0)
    assert high["sp_9"] == OnOff(period=12, duty=1, bad=1, good=1)
    assert low["sr_8"] == BadMouthing(lie="constant", level=0, targets=(0,))
    assert high["sr_9"] == BadMouthing(lie="relative", level=1, targets=tuple(range(9)))


def test_the_default_cube_is_what_it_has_always_been():
    """Worked out here as before attacks declared their ranges."""

    def on_off(x):
        return OnOff(
            period=1 + min(int(x[0] * 12), 11), duty=float(x[1]), bad=float(x[2]), good=float(x[3])
        )

    def lie(x):
        told, number = "constant" if x[0] < 0.5 else "relative", 1 + min(int(x[2] * 9), 8)
        return BadMouthing(lie=told, level=float(x[1]), targets=tuple(range(number)))

    space = scripts(CROWD)
    points = [
        *np.random.default_rng(5).random((200, 10)),
        np.full(10, 0.5),
        np.zeros(10),
        np.ones(10),
    ]
    for x in points:
        assert space.decode(x) == {"sr_8": lie(x[:3]), "sr_9": lie(x[3:6]), "sp_9": on_off(x[6:])}


def test_a_mixture_is_searched_and_its_best_kind_is_found():
    """The first kind is never bad and earns nothing, the second is a user's own with one
    parameter."""
    kinds = (partial(OnOff, duty=0.0, good=1.0), Stingy, OnOff)
    space = Scripts.of(make_task(**PROVIDER), kinds)
    assert space.size == 1 + 4
    assert space.decode([0.5, 0.25, 0.3, 0.3, 0.3]) == {"sp_2": Stingy(service=0.925)}
    for method in (RandomSearch, CmaEs):
        finding = found(method(attacks=kinds), PROVIDER, 8_000)
        assert finding.description.startswith("sp_2: on-off:period=")
        assert finding.scores.mean() > 0.1


def test_who_has_no_attack_plays_honestly_and_an_attack_that_nobody_can_play_is_refused():
    space = Scripts.of(make_task(**CROWD), (OnOff,))
    assert space.size == 4
    assert [attack["sr_8"] for attack in (space.default, space.decode([0.0] * 4))] == [
        HONEST_POLICY
    ] * 2
    with refuses(ValueError, "bad-mouthing", "sp_2"):
        Scripts.of(make_task(**PROVIDER), (OnOff, BadMouthing))


@pytest.mark.parametrize("method", [RandomSearch, CmaEs], ids=lambda method: method.__name__)
def test_attacks_with_one_parameter_are_searched_and_without_any_refused(method):
    one = (partial(OnOff, period=5, bad=0.0, good=1.0),)
    assert found(method(attacks=one), PROVIDER, 4_000).scores.mean() > 0.1
    none = (partial(OnOff, period=2, duty=0.5, bad=0.0, good=1.0),)
    with refuses(UnsuitableError, "on-off"):
        found(method(attacks=none), PROVIDER, 12_000)


def test_an_agent_with_both_roles_attacks_on_both_channels():
    policy = scripts(DUAL).default["srsp_5"]
    assert policy == Both(OnOff(), BadMouthing())
    assert (
        describe_attack({"srsp_5": policy})
        == "srsp_5: on-off:period=2,duty=0.5,bad=0,good=1 and bad-mouthing:lie=constant,level=0.5"
    )


@pytest.mark.parametrize("arguments", [PROVIDER, CROWD, DUAL], ids=["provider", "crowd", "dual"])
def test_attacks_side_by_side_score_as_alone(arguments):
    task, random = exact_task(arguments), np.random.default_rng(0)
    space = Scripts.of(task)
    attacks = [space.decode(random.random(space.size)) for _ in range(5)]
    together = mean_rewards(task, Scripted(side_by_side(attacks)), 2, (5, 3), SEARCHED)[0]
    alone = [mean_rewards(task, Scripted(attack), 2, (1, 3), SEARCHED)[0][0] for attack in attacks]
    assert together == pytest.approx(np.array(alone), abs=1e-14)


def test_random_switching_plays_side_by_side():
    task = exact_task(PROVIDER)
    attacks = [{"sp_2": OnOff(switching="random", period=4)}, {"sp_2": OnOff(duty=0)}]
    scores = mean_rewards(task, Scripted(side_by_side(attacks)), 0, (2, 50), SEARCHED)[0]
    assert np.ptp(scores[0]) > 0
    assert scores[1] == pytest.approx(0)


@pytest.mark.parametrize("method", SEARCHERS, ids=lambda method: method.name)
@pytest.mark.parametrize("arguments", [PROVIDER, CROWD, DUAL], ids=["provider", "crowd", "dual"])
def test_searchers_keep_the_budget_and_their_seed_decides(method, arguments):
    one, again, other = (found(method, arguments, 2_500, seed) for seed in (0, 0, 1))
    assert one.scores.tolist() == again.scores.tolist()
    assert one.rounds == again.rounds <= 2_500
    assert one.description == again.description
    assert other.rounds <= 2_500


def test_searchers_find_what_beats_the_default():
    default = found(PaperAttacks(), PROVIDER, 0).scores.mean()
    for method in SEARCHERS:
        assert found(method, PROVIDER, 8_000).scores.mean() > 5 * default


def test_more_budget_finds_more():
    few, many = (
        found(RandomSearch(), PROVIDER, budget).scores.mean() for budget in (1_000, 20_000)
    )
    assert many > few


@pytest.mark.parametrize("method", SEARCHERS, ids=lambda method: method.name)
def test_a_budget_too_small_is_refused(method):
    with refuses(UnsuitableError, "100", "640"):
        found(method, PROVIDER, 100)


def test_policies_side_by_side_take_as_many_identities_as_any():
    several = SideBySide((Whitewashing(reserve=2), Policy(), Whitewashing(reserve=1)))
    assert several.reserve == 2
    assert several.attacks == {"quality", "ratings", "presence"}


def test_of_the_finalists_the_best_in_new_games_is_returned() -> None:
    """The first scores may be wrong; the games in which the finalists are tried again decide."""
    arguments = {
        "scenario": "crowd-10x10",
        "max_cycles": 10,
        "compromised": ("sr_8", "sr_9"),
        "objective": "damage",
    }
    trial = ScriptTrial(arguments, Budget(20_000), seed=0)
    weak, strong, middle = (
        {name: BadMouthing(level=level) for name in ("sr_8", "sr_9")} for level in (1.0, 0.0, 0.6)
    )
    result = trial.best([weak, strong, middle], np.array([0.9, 0.5, 0.1]))
    assert result.attacker.policies == strong


def test_agents_that_agree_play_one_attack_for_each_role():
    task = make_task(**CROWD)
    kinds = (BadMouthing, OnOff)
    apart, alike = Scripts.of(task, kinds), Scripts.of(task, kinds, alike=True)
    assert apart.size == 2 * alike.rating.size + alike.serving.size
    assert alike.size == alike.rating.size + alike.serving.size
    point = np.random.default_rng(0).random(alike.size)
    attack = alike.decode(point)
    assert attack["sr_8"] == attack["sr_9"] == alike.rating.decode(point[alike.serving.size :])
    assert attack["sp_9"] == alike.serving.decode(point)
    both = Scripts.of(make_task(**DUAL), kinds, alike=True).decode(np.full(9, 0.3))["srsp_5"]
    assert isinstance(both, Both)
