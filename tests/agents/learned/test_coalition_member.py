"""Members of a coalition that decide alone, against the coalition as one mind."""

import numpy as np
import pytest
import torch
from refusals import refuses

from roletrust_agents.learned import learned, load_attacker
from roletrust_agents.learned.coalition_attacker import CoalitionAttacker
from roletrust_agents.learned.coalition_member import CoalitionSize, member_of
from roletrust_agents.learned.deep_set import DeepSet, DeepSetArchitecture, random_weights
from roletrust_env import Game, JointPolicy, Policy, make_scenario, make_task, record
from roletrust_env.evaluation.attackers import AttackedPlayers, Scripted
from roletrust_env.evaluation.measurement import HELD_OUT, mean_rewards
from roletrust_env.evaluation.specs import parse_attacks
from roletrust_env.game.rollout import rollout
from roletrust_env.game.views import view_of
from roletrust_env.testing.attacks import check_independent_games

NETWORK = DeepSet.unflatten(
    DeepSetArchitecture(units=4),
    random_weights(DeepSetArchitecture(units=4), np.random.default_rng(0)),
)
WIDE = DeepSet.unflatten(
    DeepSetArchitecture.of(4, wide=True),
    random_weights(DeepSetArchitecture.of(4, wide=True), np.random.default_rng(0)) * 0.5,
)
WORLD = {
    "max_cycles": 12,
    "agents": [
        {"role": "SR", "count": 4, "noise": 0.1},
        {"role": "SP", "count": 3, "ability": [0.3, 1.0]},
    ],
}


def task_of(*compromised, **changes):
    return make_task(
        "market",
        compromised,
        objective="mislead",
        trust_model="beta",
        like=np.zeros(()),
        **{**WORLD, **changes},
    )


def member(accomplices, raters, network=NETWORK):
    """Return a member of a coalition with this number of the four raters."""
    size = CoalitionSize(3, raters / 4, WORLD["max_cycles"])
    return member_of(network, size, accomplices, provides=bool(accomplices), description="random")


def played(task, attacker, batch=(3,)):
    """Return the rounds of a game that an attacker plays."""
    random = task.game.random(0)
    return list(rollout(AttackedPlayers(task, attacker), random, random, batch))


def test_raters_that_see_the_same_lie_as_one_mind_does():
    """Without noise and losses all raters perceive the same, and those that lie alike have the same
    trust."""
    team = ("sr_1", "sr_2", "sr_3")
    task = task_of(*team, noise=0.0, access={"kind": "everyone"}, ratings={})
    one = played(task, CoalitionAttacker(NETWORK))
    apart = played(task, Scripted(dict.fromkeys(team, member((), 3))))
    for mind, members in zip(one, apart, strict=True):
        np.testing.assert_allclose(members.state.ratings, mind.state.ratings, rtol=0, atol=1e-9)
    assert max(np.abs(mind.state.ratings[1] - mind.state.ratings[0]).max() for mind in one) > 0.05


def test_a_rater_decides_as_a_coalition_with_one_rater_does():
    task, policy = task_of("sr_2", "sp_0", "sp_2"), member((0, 2), 1)
    memory = policy.begin(None, (3,))
    for before, actions, *_ in played(task, CoalitionAttacker(NETWORK)):
        ratings, memory = policy.ratings(view_of(task.game.views(before)[1], 2), memory, None)
        np.testing.assert_allclose(ratings, actions.ratings[2], rtol=0, atol=1e-9)


def test_a_provider_decides_as_a_coalition_of_one_does():
    task, policy, chosen = task_of("sp_1"), member((1,), 0), []
    memory = policy.begin(None, (3,))
    for before, actions, *_ in played(task, CoalitionAttacker(NETWORK)):
        quality, memory = policy.quality(view_of(task.game.views(before)[0], 1), memory, None)
        np.testing.assert_allclose(quality, actions.quality[1], rtol=0, atol=1e-9)
        chosen.append(quality)
    assert np.ptp(chosen) > 0.01


def test_a_wide_provider_treats_raters_and_a_wide_rater_is_silent_as_a_coalition_of_one_is():
    task, policy, treated = task_of("sp_1"), member((1,), 0, WIDE), []
    memory = policy.begin(None, (3,))
    for before, actions, *_ in played(task, CoalitionAttacker(WIDE)):
        view = view_of(task.game.views(before)[0], 1)
        quality, memory = policy.quality(view, memory, None)
        treatment, memory = policy.treats(view, memory, None)
        np.testing.assert_allclose(quality, actions.quality[1], rtol=0, atol=1e-9)
        np.testing.assert_allclose(treatment, actions.treatment[:, 1], rtol=0, atol=1e-9)
        treated.append(treatment)
    assert np.ptp(treated) > 0.1
    task, policy, silent = task_of("sr_2"), member((), 1, WIDE), []
    memory = policy.begin(None, (3,))
    for before, actions, *_ in played(task, CoalitionAttacker(WIDE)):
        view = view_of(task.game.views(before)[1], 2)
        _, memory = policy.ratings(view, memory, None)
        withheld, memory = policy.withholds(view, memory, None)
        assert np.array_equal(withheld, actions.withheld[2])
        silent.append(withheld)
    assert 0 < np.mean(silent) < 1


def test_raters_praise_their_accomplices_and_the_names_of_these_count():
    scenario = load_attacker("universal-coalition").card.scenario
    texts = [
        f"{who}=learned:path=universal-coalition,accomplices=[sp_7,sp_8,sp_9]"
        for who in ("sr_[7-9]", "sp_[7-9]")
    ]
    policies, game = parse_attacks(texts, scenario), Game(scenario, "beta")
    assert set(policies) == {f"{role}_{place}" for role in ("sr", "sp") for place in (7, 8, 9)}
    history = record(JointPolicy(game, policies), game.random(0), (20,))
    quality, said = history.quality[:-1], history.ratings[1:, 7:]
    excess = (said - quality[:, None]).mean(axis=(0, 1, 3))
    assert excess[7:].mean() > excess[:7].mean() + 0.1


def reward(name, attacker):
    """Return the mean reward of an attacker, or of members of a coalition, in the task of a saved
    coalition."""
    card = load_attacker(name).card
    task = make_task(
        card.scenario,
        card.task.compromised,
        objective="mislead",
        trust_model="beta",
        like=np.zeros(()),
    )
    if isinstance(attacker, Policy):
        attacker = Scripted(dict.fromkeys(card.task.compromised, attacker))
    return np.mean(mean_rewards(task, attacker, 0, (1, 40), HELD_OUT))


def test_raters_lose_little_by_silence_among_them_and_cheats_that_see_only_their_own_trust_lose_much():  # noqa: E501
    for name, accomplices, least, most in (
        ("universal-raters", (), 0.9, 1.1),
        ("universal-coalition", (7, 8, 9), 0.1, 0.4),
    ):
        whole = reward(name, CoalitionAttacker(load_attacker(name).network))
        apart = reward(name, learned(name, accomplices=accomplices))
        assert least < apart / whole < most, name


@pytest.mark.parametrize(
    "policy",
    [learned("universal-raters"), learned("universal-coalition-market", accomplices=(0, 3))],
    ids=["raters", "coalition"],
)
def test_each_game_of_a_batch_is_played_as_it_is_alone_and_on_torch_as_on_numpy(policy):
    check_independent_games(policy)
    scenario = make_scenario("crowd-10x10").change(max_cycles=10, noise=0.0)
    games = [
        Game(scenario, like=like) for like in (np.zeros(()), torch.zeros((), dtype=torch.float64))
    ]
    one, other = (
        record(JointPolicy(game, {"sr_9": policy, "sr_8": policy}), game.random(0))
        for game in games
    )
    np.testing.assert_allclose(one.ratings, np.asarray(other.ratings), rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("name", "accomplices", "word"),
    [
        ("universal-coalition", (), "accomplices"),
        ("universal-raters", (0,), "accomplices"),
        ("rater-3x3", (0,), "accomplices"),
    ],
)
def test_accomplices_must_fit_the_attacker(name, accomplices, word):
    with refuses(ValueError, word):
        learned(name, accomplices=accomplices)


def test_an_accomplice_that_the_game_does_not_have_is_named():
    game = Game(make_scenario("crowd-10x10"))
    policy = learned("universal-coalition", accomplices=(10,))
    with refuses(ValueError, "accomplices", "(10,)", "10"):
        record(JointPolicy(game, {"sr_7": policy}), game.random(0))


@pytest.mark.parametrize(
    ("text", "channels"),
    [
        ("sr_2=learned:path=universal-coalition,accomplices=[sp_2]", {"quality", "ratings"}),
        ("sp_2=learned:path=universal-providers,accomplices=[sp_2]", {"quality"}),
        (
            "sp_2=learned:path=universal-providers-treatment,accomplices=[sp_2]",
            {"quality", "treatment"},
        ),
    ],
)
def test_only_a_wide_network_attacks_by_silence_and_treatment(text, channels):
    (policy,) = parse_attacks([text], make_scenario("paper-3x3")).values()
    assert policy.attacks == channels
